# SPDX-License-Identifier: Apache-2.0
"""Arms that are pushed time and again: how it is counted what is said, and short recordings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from touchline.bench.pushes import run as pushes
from touchline.bench.pushes.judge import Push, Tally, judge
from touchline.bench.pushes.run import Part, play, run
from touchline.cli import main
from touchline.result.event import Event
from touchline.result.kinds import ContactLevel, Status
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import random_trajectory

TIME = np.arange(0.0, 10.0, 0.001)


def push(begin, end, body="hand"):
    path = np.full((len(TIME), 3), np.nan)
    path[(begin <= TIME) & (end >= TIME)] = 0.0
    return Push(begin, end - 0.05, end, body, path)


def event(detected, cleared, body="hand", sure=0.95, x=0.0):
    return Event(
        id=0,
        segment="base",
        level=ContactLevel.CONTACT,
        detected=detected,
        cleared=cleared,
        status=Status.LOCATED,
        body=body,
        body_probability=sure,
        position=np.array([x, 0.0, 0.0]),
        time_of_position=detected + 0.1,
    )


PUSHES = [push(1.0, 2.0), push(4.0, 5.0)]


def test_pushes_that_are_told_as_they_were_leave_nothing_to_count():
    tally = judge(TIME, PUSHES, [event(1.01, 2.02), event(4.01, 5.02)])
    assert tally == replace(
        Tally(pushes=2, found=2, placed=2, right=2, held=2, cleared=2), free=tally.free
    )
    assert tally.free == pytest.approx(10.0 - 2 * 1.3, abs=0.01)


def test_an_event_over_two_pushes_belongs_to_one_of_them():
    tally = judge(TIME, PUSHES, [event(1.01, 5.02)])
    assert (tally.found, tally.extra, tally.cleared) == (1, 0, 1)
    assert tally.idle == pytest.approx(1.7, abs=0.01)


def test_a_second_event_of_a_push_is_one_too_many():
    tally = judge(TIME, PUSHES, [event(1.01, 1.5), event(1.6, 2.02), event(4.01, None)])
    assert (tally.found, tally.extra, tally.held, tally.cleared) == (2, 1, 1, 1)


def test_an_event_of_nothing_has_no_right_body_and_no_right_place():
    tally = judge(TIME, PUSHES, [event(3.0, 3.2), event(7.0, 7.1, sure=0.6)])
    assert (tally.found, tally.extra, tally.sure_wrong, tally.far) == (0, 2, 1, 2)


def test_what_is_said_of_another_body_is_wrong_only_if_it_is_sure():
    told = [event(1.01, 2.02, body="arm"), event(4.01, 5.02, body="arm", sure=0.7, x=0.06)]
    tally = judge(TIME, PUSHES, told)
    assert (tally.right, tally.sure_wrong, tally.far) == (0, 1, 1)


def test_no_event_at_all_is_counted_too():
    tally = judge(TIME, PUSHES, [])
    assert (tally.found, tally.cleared, tally.idle) == (0, 2, 0.0)


def test_two_pushes_of_an_arm_that_is_as_told_are_found_and_placed():
    tally = run(Part("sara", "nothing", 1, 6.0))
    assert tally.pushes == tally.found == tally.placed == tally.right == tally.cleared == 2
    assert tally.extra == tally.sure_wrong == tally.far == tally.idle == 0


def test_pushes_that_joints_alone_feel_are_not_taken_for_friction():
    """Each was learned as friction of a slow joint: it ended at once, and later ones were lost."""
    tally = run(Part("panda-torques", "bias 2 N", 1000, 9.0))
    assert tally.pushes == tally.found == tally.held == tally.cleared == 3
    assert tally.extra == 0


def test_what_a_calibration_knows_counts_at_another_rate_too(monkeypatch):
    """Places had believed the arm as if nothing were wrong: of such pushes two of 13 were right."""
    robot = described_arm("panda")
    time = np.arange(25 * 20) / 20.0
    motion = random_trajectory(robot, np.random.default_rng(8))(time)[0]
    monkeypatch.setattr(pushes, "_plan", lambda arm: SimpleNamespace(time=time, q=motion))
    tally = run(Part("panda", "several", 1, 9.0, rate=200.0))
    assert tally.pushes == tally.found == tally.right == tally.held == tally.cleared == 3
    assert tally.sure_wrong == tally.far == 0


def test_what_is_wrong_is_so_of_the_arm_or_of_its_readings():
    right = play(Part("sara", "nothing", 1, 3.0))[1]
    heavy = play(Part("sara", "payload 0.3 kg", 1, 3.0))[1]
    rubbing = play(Part("sara", "friction 1 Nm", 1, 3.0))[1]
    assert np.abs(heavy.wrench - right.wrench).max() > 1.0
    assert np.array_equal(rubbing.wrench, right.wrench)
    assert np.nanmax(np.abs(rubbing.tau - right.tau)) == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("processes", ["1", "2"])
def test_lines_of_arms_are_summed(here, monkeypatch, capsys, processes):
    here(pushes)
    counted = []

    def made_up(part):
        counted.append((part.arm, part.wrong, part.seed))
        return Tally(pushes=10, found=part.seed, idle=1.0, free=4.0)

    monkeypatch.setattr(pushes, "run", made_up)
    words = ["--arms", "sara", "ur5", "--wrong", "nothing", "bias 2 N", "--seeds", "2"]
    assert main(["bench", "pushes", *words, "--first", "3", "--processes", processes]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[2:]]
    assert [line[0] for line in lines] == ["sara", "sara", "ur5", "ur5", "all", "all"]
    assert lines[0][2:4] == ["20", "7"] and lines[0][-2:] == ["25.0", "%"]
    assert lines[-1][-13:-2] == "N 40 14 0 0 0 0 0 0 0 0".split()
    assert counted == [
        (arm, wrong, seed)
        for arm in ("sara", "ur5")
        for wrong in ("nothing", "bias 2 N")
        for seed in (3, 4)
    ]


@pytest.mark.parametrize("rate", ["0", "-50", "nan", "inf", "10", "130"])
def test_a_rate_that_no_recording_can_have_is_told(capsys, rate):
    assert main(["bench", "pushes", "--calibrate", rate]) == 2
    assert f"--calibrate {rate}: must be a multiple of 50 Hz" in capsys.readouterr().err


def test_a_benchmark_without_recordings_is_told(capsys):
    assert main(["bench", "pushes", "--seeds", "0"]) == 2
    assert "seeds" in capsys.readouterr().err
