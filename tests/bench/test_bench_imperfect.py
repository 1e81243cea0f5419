# SPDX-License-Identifier: Apache-2.0
"""Arms that are not as told, and that nobody has calibrated: a few pushes on each."""

import numpy as np
import pytest

from touchline.bench.imperfect.faults import FAULTS, PAYLOAD
from touchline.bench.imperfect.trial import Outcome, Trials
from touchline.cli import main
from touchline.trials.arms import load_arm


@pytest.fixture(scope="module")
def trials():
    return Trials(load_arm("sara", 1))


@pytest.mark.parametrize("fault", FAULTS, ids=lambda fault: fault.name)
def test_a_push_on_a_standing_arm_is_found_and_ends(trials, fault):
    outcome = trials.play(fault, False, (1,))
    assert outcome.found and outcome.cleared
    assert not outcome.wrong and not outcome.before


def test_pushes_in_motion_are_found_and_end(trials):
    heavy = next(fault for fault in FAULTS if fault.name == "masses 2 %")
    played = [trials.play(heavy, True, (2, k)) for k in range(4)]
    assert all(outcome.found and outcome.cleared for outcome in played)
    assert sum(outcome.wrong for outcome in played) <= 1


@pytest.mark.parametrize("name", ["payload 0.3 kg", "friction 1 Nm"])
def test_what_motion_has_shown_is_no_contact(name):
    # Where what joints alone have left counts as held, 6 of 10 pushes with friction end in time.
    fault = next(fault for fault in FAULTS if fault.name == name)
    trials = Trials(load_arm("panda", 1))
    played = [trials.play(fault, True, (3, k)) for k in range(10)]
    assert not any(outcome.before for outcome in played)
    assert sum(outcome.wrong for outcome in played) <= 1
    assert sum(outcome.found and outcome.cleared for outcome in played) >= 9


def test_the_payload_is_on_the_last_link_alone():
    robot = load_arm("sara", 1)
    payload = next(fault for fault in FAULTS if fault.name.startswith("payload"))
    loaded = payload.moving(robot, np.random.default_rng(0)).mechanism.links
    more = {
        n: loaded[n].inertia.mass - link.inertia.mass for n, link in robot.mechanism.links.items()
    }
    assert sum(more.values()) == pytest.approx(PAYLOAD)
    (name,) = [n for n, mass in more.items() if mass > 0.0]
    body = loaded[name].inertia
    assert (np.linalg.eigvalsh(body.inertia) >= 0.0).all()


def test_a_line_for_each_fault_and_motion(monkeypatch, capsys):
    def play(self, fault, moving, seed):
        first = seed[-1] == 0
        level = 0.95 if first else 0.3
        return Outcome(moving, True, first, not moving, 2, np.nan if moving else level)

    monkeypatch.setattr(Trials, "play", play)
    assert main(["bench", "imperfect", "--arms", "sara", "--runs", "2"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines()[2:]]
    assert len(lines) == 2 * len(FAULTS)
    assert lines[0] == "sara nothing standing 0/2 2/2 1/2 2/2 2.0 50 %".split()
    assert lines[1] == "sara nothing moving 2/2 2/2 1/2 0/2 2.0 -".split()
    assert main(["bench", "imperfect", "--arms", "sara", "ur5", "--runs", "2"]) == 0
    last = capsys.readouterr().out.splitlines()[-1].split()
    assert last[:3] == ["all", "noise", "x"] and "4/4" in last


def test_a_benchmark_without_runs_is_told(capsys):
    assert main(["bench", "imperfect", "--runs", "0"]) == 2
    assert "runs" in capsys.readouterr().err
