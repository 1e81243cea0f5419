# SPDX-License-Identifier: Apache-2.0
"""Contacts on one segment keep their identity while they slide, lift, merge and split."""

import numpy as np
import pytest
from shapes import chain
from timeline import Push, contacts_at, follow, ramp, where

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5])
ROBOT = chain((0.3,) * 6)
PLACES = {"link2": [0.13, 0.04, 0.01], "link4": [0.10, -0.01, -0.04], "link6": [0.15, 0.02, 0.04]}
FORCES = {"link2": [2.0, -18.0, 3.0], "link4": [-1.0, 2.0, 15.0], "link6": [3.0, 1.0, -12.0]}
NOISE = pytest.mark.parametrize("seed", [None, 1], ids=["noise-free", "noise"])


def push(link, begin, end=np.inf, place=None, force=None, way=(0.0, 0.0, 0.0)):
    """A push from `begin` to `end` [s] that slides along -x: `way` is when [s], speed, distance."""
    at = np.array(PLACES[link] if place is None else place)
    full = np.array(FORCES[link] if force is None else force)
    start, speed, distance = way

    def slid(time):
        return at - [np.clip((time - start) * speed, 0.0, distance), 0.0, 0.0]

    return Push(link, slid, lambda t: full * (ramp(t, begin) - ramp(t, end)))


def links(pipeline):
    return [(event.id, event.link) for event in pipeline.events]


def check(found, one, time, position, force):
    assert found["link"] == one.link and found["status"] == "located"
    error = np.linalg.norm(found["position"] - where(ROBOT, Q, one, time))
    R = ROBOT.T_world_links(Q)[one.link][:3, :3]
    assert error < position
    assert np.linalg.norm(found["force"] - R @ one.force(time)) < force


def check_all(pipeline, time, expected):
    """Just these contacts: of each number the push, and what its place may be off [m]."""
    found = contacts_at(pipeline, time)
    assert set(found) == set(expected)
    for number, (one, position) in expected.items():
        check(found[number], one, time, position, 0.2)


@NOISE
@pytest.mark.parametrize("held", ["link4", "link6"])
@pytest.mark.parametrize("speed", [0.15, 0.03])
def test_a_contact_slides_beside_another_that_is_held(held, speed, seed):
    distance = 0.4 * speed + 0.012
    pushes = [push(held, 0.06), push("link2", 0.2, way=(0.3, speed, distance))]
    end = 0.3 + distance / speed
    pipeline = follow(ROBOT, Q, pushes, end + 0.2, seed)
    assert links(pipeline) == [(0, held), (1, "link2")]
    for time in np.arange(0.3, end, 0.02):  # while it slides: behind by the filter and the test
        found = contacts_at(pipeline, float(time))
        assert set(found) == {0, 1}
        check(found[0], pushes[0], time, 1.5e-3, 0.5)
        moved = np.linalg.norm(found[1]["position"] - where(ROBOT, Q, pushes[1], time))
        assert found[1]["link"] == "link2" and moved < 1e-2
    found = contacts_at(pipeline, end + 0.15)
    check(found[0], pushes[0], end, 1.5e-3, 0.5)
    check(found[1], pushes[1], end, 4e-3, 0.5)


@NOISE
@pytest.mark.parametrize("rest", [0.05, 0.6])
def test_an_event_of_a_contact_that_slid_has_the_place_of_its_time(rest, seed):
    """Where it was for longest, at a time when it was there."""
    slid = push("link2", 0.2, way=(0.5, 0.15, 0.06))
    pipeline = follow(ROBOT, Q, [push("link6", 0.06), slid], 0.9 + rest, seed)
    event = next(event for event in pipeline.events if event.link == "link2")
    assert event.status == "located"
    then = where(ROBOT, Q, slid, event.time_of_position)
    assert np.linalg.norm(event.position - then) < 0.0225


@NOISE
@pytest.mark.parametrize(("lifts", "stays"), [("link2", "link6"), ("link6", "link2")])
def test_one_of_two_lifts_and_the_other_keeps_its_identity(lifts, stays, seed):
    pushes = [push("link2", 0.06), push("link6", 0.2)]
    order = [one.link for one in pushes]
    k = order.index(lifts)
    pushes[k] = push(lifts, 0.06 if k == 0 else 0.2, 0.4)
    pipeline = follow(ROBOT, Q, pushes, 0.7, seed)
    assert links(pipeline) == [(0, "link2"), (1, "link6")]
    gone, left = pipeline.events[k], pipeline.events[1 - k]
    assert 0.42 < gone.cleared < 0.5 and left.cleared is None
    for time in (0.5, 0.69):
        (alone,) = contacts_at(pipeline, time).items()
        assert alone[0] == left.id
        check(alone[1], pushes[1 - k], time, 4e-3, 0.3)


@NOISE
def test_one_that_comes_back_is_a_new_contact(seed):
    again = push("link6", 0.5)
    pushes = [push("link2", 0.06), push("link6", 0.2, 0.35), again]
    pipeline = follow(ROBOT, Q, pushes, 0.8, seed)
    assert links(pipeline) == [(0, "link2"), (1, "link6"), (2, "link6")]
    check_all(pipeline, 0.79, {0: (pushes[0], 1e-3), 2: (again, 2e-3)})


@NOISE
def test_of_two_that_merge_into_one_place_the_older_goes_on(seed):
    """The second slides 6 cm along the link to within 1 cm of the first."""
    first = push("link2", 0.06, place=[0.10, 0.04, 0.0])
    second = push(
        "link2", 0.2, place=[0.17, 0.04, 0.01], force=[1.0, -12.0, 0.0], way=(0.4, 0.15, 0.06)
    )
    pipeline = follow(ROBOT, Q, [first, second], 1.2, seed)
    assert links(pipeline) == [(0, "link2"), (1, "link2")]
    assert pipeline.events[0].cleared is None
    assert 0.7 < pipeline.events[1].cleared < 1.1  # after it has come close
    ((alone, found),) = contacts_at(pipeline, 1.19).items()
    assert alone == 0 and found["status"] == "located"
    middle = 0.6 * where(ROBOT, Q, first, 1.2) + 0.4 * where(ROBOT, Q, second, 1.2)
    assert np.linalg.norm(found["position"] - middle) < 3e-3
    R = ROBOT.T_world_links(Q)["link2"][:3, :3]
    assert np.linalg.norm(found["force"] - R @ (first.force(1.2) + second.force(1.2))) < 0.3


@NOISE
def test_a_contact_that_splits_in_two_keeps_its_identity(seed):
    """A part of its force goes over to link 6, all at once: eight unknowns, ten equations."""
    stays = push("link2", 0.06)
    leaves = push("link2", 0.06, 0.4, force=[1.0, -12.0, 0.0])
    lands = push("link6", 0.4)
    pipeline = follow(ROBOT, Q, [stays, leaves, lands], 0.7, seed)
    assert links(pipeline) == [(0, "link2"), (1, "link6")]
    check_all(pipeline, 0.69, {0: (stays, 1e-3), 1: (lands, 2e-3)})


@NOISE
def test_a_split_on_one_link_is_not_separable(seed):
    """Six equations for eight unknowns: no place is named for the part that slides away."""
    stays = push("link2", 0.06, place=[0.16, 0.04, 0.0])
    leaves = push(
        "link2", 0.06, place=[0.16, 0.04, 0.0], force=[1.0, -9.0, 8.0], way=(0.3, 0.2, 0.06)
    )
    pipeline = follow(ROBOT, Q, [stays, leaves], 1.0, seed)
    first, *others = pipeline.events
    assert first.link == "link2" and first.cleared is None
    found = contacts_at(pipeline, 0.95)
    assert found[0]["status"] != "located"
    assert all(np.isnan(found[event.id]["position"]).all() for event in others if event.id in found)
