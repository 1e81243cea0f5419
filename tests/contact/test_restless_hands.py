# SPDX-License-Identifier: Apache-2.0
"""Two hands that tremble, with fewer equations than unknowns: no place seems to be known."""

import numpy as np
import pytest

from touchline.bench.localization.course import follow_course
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


@pytest.mark.parametrize(
    ("run", "seed"),
    [
        pytest.param(95, 5, id="behind the link, where one more curve explains"),
        pytest.param(29, 6, id="along a curve on a round link"),
        pytest.param(32, 6, id="behind an edge, where no force on it is in the cone"),
        pytest.param(69, 0, id="three centimetres along the link"),
        pytest.param(15, 41, id="while the first hand seems to slide"),
        pytest.param(61, 42, id="while it seems to slide, on the other side of the link"),
        pytest.param(51, 42, id="where the first hand would pull"),
        pytest.param(40, 43, id="by a region that the unrest may widen"),
    ],
)
def test_what_forces_that_change_leave_open_is_not_located(run, seed):
    """A place is sure only where the equations tell it, with the unrest of both hands."""
    robot, _, skin = told_and_real(CELL, run)
    scene = make_scene(CELL, run, seed)
    pipeline, s = make_pipeline(robot, skin), scene.signals
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    course = follow_course(pipeline, scene)
    assert course.samples > 1900
    assert course.wrong == 0


def test_a_newcomer_is_in_its_region_all_the_time():
    robot, _, skin = told_and_real(CELL, 29)
    scene = make_scene(CELL, 29, 6)
    pipeline, s = make_pipeline(robot, skin), scene.signals
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    table, link = pipeline.contacts, scene.touches[1][0].patch.link
    onset = scene.touches[1][1]
    late = s.time[table.sample] > onset + 0.05
    mine = np.flatnonzero(late & (table.columns()["link"] == link))
    assert len(mine) > 1500
    for row in mine[::50]:
        contact, place = table[int(row)], scene.places[1, table.sample[row]]
        variances, axes = np.linalg.eigh(contact.covariance)
        off = axes[:, 1:].T @ (contact.position - place)
        assert np.sum(off**2 / variances[1:]) < MOST


@pytest.mark.parametrize(("run", "seed"), [(95, 5), (69, 7)])
def test_an_event_is_no_surer_of_its_place_than_any_sample(run, seed):
    """Followed contacts: each sample speaks of all before it, so that they do not add up."""
    robot, _, skin = told_and_real(CELL, run)
    scene = make_scene(CELL, run, seed)
    pipeline, s = make_pipeline(robot, skin), scene.signals
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    table = pipeline.contacts.columns()
    for event in pipeline.events:
        said = set(table["status"][table["event"] == event.id].tolist())
        assert event.status != "located" or "located" in said
    assert follow_course(pipeline, scene).false == 0
