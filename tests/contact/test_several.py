# SPDX-License-Identifier: Apache-2.0
"""Several contacts on one segment that begin one after the other."""

import numpy as np
import pytest
from shapes import chain

from touchline.bench.touches import Touch, resting_signals
from touchline.contact.pipeline import Pipeline
from touchline.contact.skin import Skin

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5])
# In the frame of the link: place and force of pushes on boxes 8 cm thick.
PUSHES = {
    "link2": ([0.13, 0.04, 0.01], [2.0, -18.0, 3.0]),
    "link4": ([0.10, -0.01, -0.04], [-1.0, 2.0, 15.0]),
    "link6": ([0.15, 0.02, 0.04], [3.0, 1.0, -12.0]),
}


@pytest.fixture(scope="module")
def arm():
    robot = chain((0.3,) * 6)
    return robot, Skin(robot)


def touch(arm, link):
    robot, skin = arm
    patch = next(patch for patch in skin.patches if patch.link == link)
    T = robot.T_world_links(Q)[link]
    place, force = (np.array(values) for values in PUSHES[link])
    return Touch(Q, patch, T[:3, :3] @ place + T[:3, 3], np.zeros(3), T[:3, :3] @ force)


def follow(arm, timed, duration, noise=None):
    """A pipeline that has felt touches: (link, begin, end)."""
    robot, skin = arm
    touches = [touch(arm, link) for link, *_ in timed]
    total = resting_signals(robot, Q, [], duration, noise)
    for one, (_, begin, end) in zip(touches, timed, strict=True):
        quiet = resting_signals(robot, Q, [], duration, None)
        pushed = resting_signals(robot, Q, [(one, begin)], duration, None)
        during = total.time < end
        total.tau[during] += (pushed.tau - quiet.tau)[during]
        total.wrench[during] += (pushed.wrench - quiet.wrench)[during]
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0)
    pipeline.run(total.time, total.q, total.qd, total.tau, total.wrench)
    return pipeline, touches


def last_contacts(pipeline):
    table, columns = pipeline.contacts, pipeline.contacts.columns()
    rows = np.flatnonzero(table.sample == table.sample.max())
    return {
        columns["link"][i]: (
            columns["status"][i],
            np.array([columns[axis][i] for axis in "xyz"]),
            np.array([columns[axis][i] for axis in ("fx", "fy", "fz")]),
        )
        for i in rows
    }


@pytest.mark.parametrize("order", [("link4", "link2"), ("link2", "link6", "link4")])
def test_contacts_that_begin_one_after_the_other_are_exact(arm, order):
    timed = [(link, 0.06 + 0.1 * i, 9.0) for i, link in enumerate(order)]
    pipeline, touches = follow(arm, timed, 0.06 + 0.1 * len(order))
    found = last_contacts(pipeline)
    assert set(found) == set(order)
    for link, one in zip(order, touches, strict=True):
        status, position, force = found[link]
        assert status == "located"
        np.testing.assert_allclose(position, one.position, atol=1e-3)
        np.testing.assert_allclose(force, one.force, atol=0.1)


def test_the_order_of_the_contacts_does_not_matter(arm):
    places = []
    for order in (("link2", "link6"), ("link6", "link2")):
        timed = [(link, 0.06 + 0.1 * i, 9.0) for i, link in enumerate(order)]
        places.append(last_contacts(follow(arm, timed, 0.3)[0]))
    for link in places[0]:
        np.testing.assert_allclose(places[0][link][1], places[1][link][1], atol=1e-3)


def test_the_first_contact_may_go_while_the_second_stays(arm):
    pipeline, (_, second) = follow(arm, [("link2", 0.06, 0.26), ("link6", 0.16, 9.0)], 0.4)
    events = pipeline.events
    assert [event.link for event in events] == ["link2", "link6"]
    assert 0.26 < events[0].cleared < 0.34
    assert events[1].cleared is None
    (found,) = last_contacts(pipeline).values()
    np.testing.assert_allclose(found[1], second.position, atol=1e-3)
    assert set(pipeline.contacts.event[pipeline.contacts.sample > 380]) == {events[1].id}


def test_contacts_are_found_in_noise(arm):
    timed = [("link2", 0.06, 9.0), ("link6", 0.16, 9.0), ("link4", 0.26, 9.0)]
    pipeline, touches = follow(arm, timed, 0.4, np.random.default_rng(3))
    assert [event.status for event in pipeline.events] == ["located"] * 3
    for event, one in zip(pipeline.events, touches, strict=True):
        assert event.link == one.patch.link
        assert np.linalg.norm(event.position - one.position) < 0.01
        assert np.linalg.norm(event.force - one.force) < 1.5  # its rise counts as well
