# SPDX-License-Identifier: Apache-2.0
"""An arm that is calibrated on two minutes of motion stands in other poses, and moves otherwise."""

import numpy as np
import pytest

from touchline.bench import calibrated
from touchline.bench.calibrated import PUSHES, WRONGS, Arm, Told
from touchline.cli import main
from touchline.trials.arms import load_arm


@pytest.mark.parametrize("wrong", WRONGS[:2], ids=lambda wrong: wrong.name)
def test_other_postures_are_no_contacts(wrong):
    """With one threshold for all postures this UR5 feels 131 contacts that do not exist."""
    arm = Arm(load_arm("ur5", 1), wrong, 1)
    told = arm.told(arm.calibrated())
    assert told.standing + told.moving <= 1  # in 15 minutes
    assert told.found >= 0.95 * PUSHES


class MadeUp:
    """An arm whose figures are made up; a bias makes its calibrated threshold 1.5 times as high."""

    def __init__(self, robot, wrong, seed):
        self.wrong, self.seed = wrong, seed

    def calibrated(self):
        return 1.5 if self.wrong.bias else 1.0

    def told(self, robot):
        return Told(0, 1, 20) if isinstance(robot, float) else Told(3, 2 + self.seed, 10)


def test_both_kinds_of_thresholds_are_printed(monkeypatch, capsys):
    monkeypatch.setattr(calibrated, "Arm", MadeUp)
    monkeypatch.setattr(calibrated, "_contacts", lambda robot: np.array([1.0, robot]))
    assert main(["bench", "calibrated", "--arms", "sara", "--runs", "2"]) == 0
    lines = [line.split() for line in capsys.readouterr().out.splitlines() if "sara" in line]
    assert len(lines) == 2 * len(WRONGS)
    for line in lines:
        figures = ["0", "2", "40/40"] if "calibrated" in line else ["6", "5", "20/40"]
        assert line[-5:-2] == figures or line[-4:-1] == figures
    assert lines[-1][-2:] == ["1.50", "times"] and lines[-2][-1] == lines[0][-1] == "-"


def test_a_benchmark_without_runs_is_told(capsys):
    assert main(["bench", "calibrated", "--runs", "0"]) == 2
    assert "runs" in capsys.readouterr().err
