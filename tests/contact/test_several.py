# SPDX-License-Identifier: Apache-2.0
"""Several contacts on one segment, one after the other or at the same instant."""

import numpy as np
import pytest
from shapes import chain

from touchline.localizer.skin import Skin
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.moving import moving_signals
from touchline.trials.touches import Touch, resting_signals, touch_loads

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


def test_superposition(arm):
    """What a contact does to the rows does not depend on the others."""
    both, _ = follow(arm, [("link2", 0.06, 9.0), ("link6", 0.16, 9.0)], 0.3)
    alone = {
        link: last_contacts(follow(arm, [(link, 0.06, 9.0)], 0.3)[0])[link]
        for link in ("link2", "link6")
    }
    for link, (_, position, force) in last_contacts(both).items():
        np.testing.assert_allclose(position, alone[link][1], atol=1e-3)
        np.testing.assert_allclose(force, alone[link][2], atol=0.1)


def test_a_change_of_both_forces_is_no_new_contact(arm):
    timed = [("link2", 0.06, 9.0), ("link6", 0.16, 9.0), ("link2", 0.26, 9.0), ("link6", 0.26, 9.0)]
    pipeline, _ = follow(arm, timed, 0.4)
    assert [event.link for event in pipeline.events] == ["link2", "link6"]
    for link, (_, _, force) in last_contacts(pipeline).items():
        assert np.linalg.norm(force) == pytest.approx(2 * np.linalg.norm(PUSHES[link][1]), rel=0.02)


def test_two_at_the_same_instant_are_told_apart_where_the_equations_suffice(arm):
    """Link 2 and link 6 have four joints between them: ten equations for ten unknowns."""
    pipeline, touches = follow(arm, [("link2", 0.06, 9.0), ("link6", 0.06, 9.0)], 0.2)
    found = last_contacts(pipeline)
    assert set(found) == {"link2", "link6"}
    for one in touches:
        status, position, force = found[one.patch.link]
        assert status in ("located", "ambiguous")
        np.testing.assert_allclose(position, one.position, atol=2e-3)
        np.testing.assert_allclose(force, one.force, atol=0.3)


@pytest.mark.parametrize("links", [("link2", "link4"), ("link4", "link6")])
def test_without_enough_equations_no_place_is_named_but_all_that_may_be(arm, links):
    pipeline, touches = follow(arm, [(link, 0.06, 9.0) for link in links], 0.2)
    (event,) = pipeline.events
    assert (event.status, event.position, event.unknowns) == ("not_separable", None, 10)
    assert event.rank is not None and event.rank < 10
    for one in touches:
        assert any(
            candidate.link == one.patch.link
            and np.linalg.norm(candidate.position - one.position) < candidate.radius
            for candidate in event.candidates
        )


def moved(arm, timed, speed, rng):
    """A pipeline that has felt touches while every joint turns, and the last positions."""
    robot, skin = arm
    touches = [(touch(arm, link), begin) for link, begin in timed]
    s = moving_signals(robot, touches, 0.36, speed, rng, None)
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    start, end = robot.T_world_links(Q), robot.T_world_links(s.q[-1])
    return pipeline, {
        one.patch.link: (
            end[one.patch.link] @ np.linalg.inv(start[one.patch.link]) @ [*one.position, 1.0]
        )[:3]
        for one, _ in touches
    }


def test_contacts_stay_on_their_links_while_the_arm_moves(arm):
    timed = [("link2", 0.06), ("link6", 0.16), ("link4", 0.26)]
    pipeline, places = moved(arm, timed, 1.0, np.random.default_rng(5))
    found = last_contacts(pipeline)
    assert set(found) == set(places)
    assert [event.link for event in pipeline.events] == ["link2", "link6", "link4"]
    for link, place in places.items():
        assert np.linalg.norm(found[link][1] - place) < 5e-3


@pytest.mark.parametrize("other", [None, "link6"])
def test_a_contact_that_slides_keeps_its_event(arm, other):
    """Along link 2 at 0.15 m/s, alone and with another contact on link 6."""
    robot, skin = arm
    duration, begin, speed = 0.9, 0.2, 0.15
    patch = next(patch for patch in skin.patches if patch.link == "link2")
    T, (place, force) = robot.T_world_links(Q)["link2"], PUSHES["link2"]
    still = [] if other is None else [(touch(arm, other), 0.06)]
    s = resting_signals(robot, Q, still, duration, None)
    world = T[:3, :3] @ force
    for i in np.flatnonzero(s.time >= begin):
        way = np.clip(s.time[i] - begin - 0.1, 0.0, 0.5) * speed
        point = T[:3, :3] @ (np.array(place) - [way, 0.0, 0.0]) + T[:3, 3]
        loads = touch_loads(robot, Q, patch.node, point, world)
        s.tau[i] -= loads[: len(Q)]
        s.wrench[i] -= loads[len(Q) :].reshape(-1, 6)
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    assert [event.link for event in pipeline.events] == [x for x in (other, "link2") if x]
    last = T[:3, :3] @ (np.array(place) - [0.5 * speed, 0.0, 0.0]) + T[:3, 3]
    assert np.linalg.norm(last_contacts(pipeline)["link2"][1] - last) < 3e-3
