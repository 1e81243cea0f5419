# SPDX-License-Identifier: Apache-2.0
"""The benchmark of identification: arms with one error each, and what is printed of many."""

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from touchline.bench.identify import injected, run
from touchline.bench.identify.arms import ARMS
from touchline.bench.identify.bound import Bound, least_errors
from touchline.bench.identify.injected import GOALS, Figure, Judgement, judge
from touchline.bench.identify.pushes import Detected
from touchline.cli import main
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm


@pytest.mark.parametrize(("kind", "figure"), [("frame", "turn"), ("falling friction", "stribeck")])
def test_what_is_wrong_with_an_arm_is_found(tmp_path, monkeypatch, kind, figure):
    """After half a minute of motion, where the benchmark has its planned one."""
    monkeypatch.setattr(injected, "OTHERS", 1)
    monkeypatch.setattr(injected, "SECONDS", 8.0)
    robot, rng, time = (
        load_arm("sara-full", 1),
        np.random.default_rng(0),
        np.arange(0.0, 30.0, 0.05),
    )
    plan = SimpleNamespace(time=time, q=random_trajectory(robot, rng)(time)[0])
    judged = judge(make_wrong_arm(robot, kind, rng), plan, rng, tmp_path)
    found = judged.figures
    assert found[figure].told and found["claimed"].error == 0.0
    for name in {"force", "moment", "mass", "centre", figure}:
        assert found[name].error <= GOALS[name][1], name
    after, before = judged.felt["after"], judged.felt["before"]
    assert after.found == after.pushes >= before.found and after.false <= before.false


def minute(robot, seconds=20.0) -> Any:
    """A motion in place of the planned one, which takes long to find."""
    time = np.arange(0.0, seconds, 0.02)
    motion = random_trajectory(robot, np.random.default_rng(3))
    return SimpleNamespace(time=time, q=motion(time)[0])


def test_no_motion_tells_a_payload_from_links_that_are_off():
    """Joints feel sums of links: less noise leaves the mass as unknown as it was."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data in the test group")
    robot = load_arm("panda", 1)
    noise = robot.description.noise
    less = replace(
        noise,
        tau=tuple(0.1 * x for x in noise.tau),
        sensors={name: tuple(0.1 * x for x in own) for name, own in noise.sensors.items()},
    )
    quiet = Robot(replace(robot.description, noise=less), robot.mechanism)
    a, b = (least_errors(r, minute(r), 50.0) for r in (robot, quiet))
    assert 0.02 < b.mass <= a.mass < 0.05
    assert b.shift["base"] < 0.2 * a.shift["base"] and b.delay["base"] < 0.2 * a.delay["base"]


def test_a_sensor_at_the_wrist_tells_a_payload():
    robot = load_arm("sara-full", 1)
    found = least_errors(robot, minute(robot), 50.0)
    assert found.mass < 1e-3 and found.of("mass", "") == 1e3 * found.mass
    assert found.of("turn", "wrist") < 0.1 and np.isnan(found.of("friction", ""))


def judgement(error, found=4):
    figures = {"mass": Figure(error), "delay": Figure(0.1, False, "torques")}
    felt = {"before": Detected(4, 2, 1, 0.5), "after": Detected(4, found, 0, 0.0)}
    return Judgement(figures, felt)


@pytest.fixture
def planned(monkeypatch):
    """No motion is planned and nothing is simulated: what is judged comes from a list."""
    monkeypatch.setattr(injected, "make_plan", lambda robot: None)
    bound = Bound(0.02, 0.001, {}, {}, {"torques": 1e-5})
    monkeypatch.setattr(injected, "least_errors", lambda robot, plan, rate: bound)
    monkeypatch.setattr(injected, "make_wrong_arm", lambda robot, kind, rng: kind)
    answers = []

    def judged(case, plan, rng, folder):
        answer = answers.pop(0)
        if isinstance(answer, Exception):
            raise answer
        return answer

    monkeypatch.setattr(injected, "judge", judged)
    return answers


WORDS = ["bench", "identify", "--arms", "sara-full", "--kinds", "bias", "delay", "gain"]


@pytest.mark.parametrize(
    ("answers", "status", "line"),
    [
        (
            [judgement(9.0), judgement(1.0)],
            0,
            "mass 10 g 2 2 5 9 2 6.4 20",
        ),
        (
            [judgement(9.0), judgement(11.0)],
            1,
            "mass 10 g 2 2 10 11 1 10 20",
        ),
        ([judgement(9.0, found=0), judgement(9.0, found=3)], 1, "after   3 of 8"),
        ([judgement(9.0), InputError("log: no")], 1, "refused, so nothing was written: sara-full"),
    ],
)
def test_a_goal_that_is_missed_is_told(planned, capsys, answers, status, line):
    """Two kinds of arms are judged; gains of currents are none of an arm without motors."""
    planned += answers
    assert main([*WORDS, "--runs", "1"]) == status
    told = capsys.readouterr().out
    assert " ".join(line.split()) in " ".join(told.split())
    assert "name their folder with --data" in told and not planned


@pytest.fixture
def real(monkeypatch):
    """Two real arms whose figures are made up; `changed` makes them worse."""
    monkeypatch.setattr(run, "ARMS", ARMS[:1])
    one = np.ones(2)
    part = run.Judgement(ARMS[0], one, 0.5 * one, 0.4 * one)
    told = {"judged": part, "masses": [(0.9, 0.01), (0.91, 0.01)]}
    told["felt"] = {"before": Detected(6, 3, 1, 0.1), "after": Detected(6, 5, 0, 0.0)}
    monkeypatch.setattr(run, "judge", lambda arm, data: told["judged"])
    monkeypatch.setattr(run, "judge_regions", lambda arm, data: [told["judged"]] * 2)
    monkeypatch.setattr(run, "tool_masses", lambda data: told["masses"])
    monkeypatch.setattr(run, "detect", lambda arm, data: told["felt"])
    return told


def test_real_arms_are_printed(real, tmp_path, capsys):
    assert main(["bench", "identify", "--runs", "0", "--data", str(tmp_path)]) == 0
    told = capsys.readouterr().out
    assert "50.0 %    55 %   40.0 %  none" in told and "50.0 -> 40.0, 50.0 -> 40.0 %" in told
    assert "0.900 +- 0.010 kg, 0.910 +- 0.010 kg" in told
    assert [line.split()[-4:-2] for line in told.splitlines()[-2:]] == [["3/6", "1"], ["5/6", "0"]]


@pytest.mark.parametrize("wrong", ["left", "learned", "joint", "masses", "felt"])
def test_real_arms_that_miss_a_limit_are_told(real, tmp_path, wrong):
    part = real["judged"]
    worse = {
        "left": {"judged": replace(part, after=0.9 * part.before, learned=0.1 * part.before)},
        "learned": {"judged": replace(part, learned=part.before)},
        "joint": {"judged": replace(part, after=np.array([0.0, 1.01]), learned=0.0 * part.after)},
        "masses": {"masses": [(0.9, 0.01), (0.96, 0.01)]},
        "felt": {"felt": {"before": Detected(6, 3), "after": Detected(6, 2)}},
    }
    real |= worse[wrong]
    assert main(["bench", "identify", "--runs", "0", "--data", str(tmp_path)]) == 1


def test_a_folder_that_is_not_there_is_told(tmp_path, capsys):
    assert main(["bench", "identify", "--runs", "0", "--data", str(tmp_path / "no")]) == 2
    assert "no such folder" in capsys.readouterr().err
