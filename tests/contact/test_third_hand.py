# SPDX-License-Identifier: Apache-2.0
"""A third hand beside two that are held, on an arm that turns: it is no channel's error."""

import numpy as np
import pytest

from touchline.trials.cell import Cell
from touchline.trials.scene import make_pipeline, make_scene, told_and_real

pytest.importorskip("pinocchio", reason="comes with example-robot-data in the test group")
NEAR = 5e-3  # m


def last_places(arm, run, seed):
    """Each touch's distance [m] from the nearest contact at the last sample; the statuses."""
    cell = Cell(arm, 3, 1, "apart", 1.0)
    robot, _, skin = told_and_real(cell, run)
    scene = make_scene(cell, run, seed)
    pipeline, s = make_pipeline(robot, skin), scene.signals
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    table = pipeline.contacts
    last = table.sample == len(s.time) - 1
    apart = np.linalg.norm(scene.places[:, -1][:, None] - table.position[last], axis=2)
    return apart.min(axis=1, initial=np.inf), table.columns()["status"][last]


@pytest.mark.parametrize(
    ("arm", "run", "seed"),
    [
        pytest.param("ur5", 46, 5, id="on the shoulder, against both"),
        pytest.param("ur5", 70, 6, id="on the shoulder"),
        pytest.param("panda", 24, 5, id="from below"),
    ],
)
def test_one_that_pushes_against_two_is_no_faulty_channel(arm, run, seed):
    """With the forces of both free, a channel would explain nearly any third contact."""
    apart, status = last_places(arm, run, seed)
    assert status.tolist() == ["located"] * 3
    assert apart.max() < NEAR
