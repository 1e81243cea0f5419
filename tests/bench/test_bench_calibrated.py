# SPDX-License-Identifier: Apache-2.0
"""An arm that is calibrated on two minutes of motion stands in other poses, and moves otherwise."""

import pytest

from touchline.bench.calibrated import PUSHES, WRONGS, Arm
from touchline.cli import main
from touchline.trials.arms import load_arm


@pytest.mark.parametrize("wrong", WRONGS[:2], ids=lambda wrong: wrong.name)
def test_other_postures_are_no_contacts(wrong):
    """With one threshold for all postures this UR5 feels 131 contacts that do not exist."""
    arm = Arm(load_arm("ur5", 1), wrong, 1)
    told = arm.told(arm.calibrated())
    assert told.standing + told.moving <= 1  # in 15 minutes
    assert told.found >= 0.95 * PUSHES


def test_a_benchmark_without_runs_is_told(capsys):
    assert main(["bench", "calibrated", "--runs", "0"]) == 2
    assert "runs" in capsys.readouterr().err
