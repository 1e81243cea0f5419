# SPDX-License-Identifier: Apache-2.0
"""Two hands that tremble, with fewer equations than unknowns: no place seems to be known."""

import numpy as np
import pytest

from touchline.trials.cell import Cell
from touchline.trials.scene import make_pipeline, make_scene, told_and_real

pytest.importorskip("pinocchio", reason="comes with example-robot-data in the test group")
CELL = Cell("ur5", 2, 1, "apart", 0.0, "", 0.0, True, "trembling")
MOST = 25.0  # of the squared distance in sigmas, of two coordinates: one in 250,000


@pytest.mark.parametrize(
    "run",
    [
        pytest.param(37, id="over the faces of a curved link"),
        pytest.param(33, id="at an edge of its link"),
    ],
)
def test_a_place_that_creeps_is_no_surer_than_right(run):
    robot, _, skin = told_and_real(CELL, run)
    scene = make_scene(CELL, run, 7)
    pipeline, s = make_pipeline(robot, skin), scene.signals
    pipeline.run(s.time[:-1], s.q[:-1], s.qd[:-1], s.tau[:-1], s.wrench[:-1])
    result = pipeline.update(float(s.time[-1]), s.q[-1], s.qd[-1], s.tau[-1], s.wrench[-1])
    second = [
        contact for contact in result.contacts if contact.link == scene.touches[1][0].patch.link
    ]
    assert len(result.contacts) == 2 and len(second) == 1
    off = second[0].position - scene.places[1, -1]
    variances, axes = np.linalg.eigh(second[0].covariance)
    assert np.linalg.norm(off) < 0.01
    assert np.sum((axes[:, 1:].T @ off) ** 2 / variances[1:]) < MOST
