# SPDX-License-Identifier: Apache-2.0
"""Pushes beside a rim: where the line grazes one face, the face beside it is looked at as well."""

import numpy as np
import pytest

from touchline.trials.cell import Cell
from touchline.trials.scene import make_pipeline, make_scene, told_and_real


@pytest.mark.parametrize(("arm", "tier", "run"), [("sara", 1, 59), ("sara", 2, 59)])
def test_the_pushed_face_is_never_lost_to_one_that_is_grazed(arm, tier, run):
    # In noise the line passes a millimetre beside the pushed face, into the side below its rim;
    # 160 mm on it enters the link once more.
    cell = Cell(arm, tier=tier)
    robot, _, skin = told_and_real(cell, run)
    scene = make_scene(cell, run)
    s = scene.signals
    pipeline = make_pipeline(robot, skin, model_error=0.0)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    place = scene.places[0, -1]
    columns = pipeline.contacts.columns()
    late = pipeline.contacts.sample > 600
    found = np.column_stack([columns[axis] for axis in "xyz"]).astype(float)[late]
    assert (columns["status"][late] == "located").all()
    assert np.linalg.norm(found - place, axis=1).max() < 5e-3
