# SPDX-License-Identifier: Apache-2.0
"""Friction of joints that turn loads no sensor: it is learned, and makes no contact."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import swaying

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.observer.dynamics import contact_loads
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import MotionMaker

RATE, SECONDS = 500.0, 5.0
FRICTION, TURN = 1.0, 0.01  # Nm, and over which speed it changes its sign [rad/s]


@pytest.fixture(scope="module")
def arm():
    return load_arm("panda", 1)


def motion(arm):
    """Every joint turns to and fro, each at other times."""
    n = len(arm.joint_names)
    way = swaying(n, 0.2, 2.0, 3.5)
    maker = MotionMaker(arm, arm, RATE, SECONDS)
    return maker, *maker.loads(replace(way, center=way.center - np.eye(n)[3] * 1.5))


def events(arm, friction, torque=None, push=None):
    """Of the moving arm with friction, and with a torque on one joint or a force on a link."""
    maker, q, qd, loads = motion(arm)
    if torque is not None:
        loads[:, 6] -= torque(maker.time)
    if push is not None:
        press(arm, q, loads, push(maker.time))
    return felt(arm, maker.sensed(q, qd, loads, np.random.default_rng(1)), friction)


def press(arm, q, loads, force):
    """Adds what a force (N, 3) [N] in world at the origin of the sixth link does to the loads."""
    n = q.shape[1]
    node = next(p.node for p in Skin(arm).patches if p.link == "panda_link6")
    at = np.array([arm.poses(x)[node][:3, 3] for x in q])
    contact = contact_loads(arm, q, "panda_link6", np.hstack([force, np.cross(at, force)]))
    loads[:, :n] -= contact.torque
    loads[:, n:] -= contact.wrench.reshape(len(q), -1)


def felt(arm, s, friction):
    pipeline = tl.Pipeline(arm, period=1.0 / RATE)
    pipeline.run(s.time, s.q, s.qd, s.tau + friction * np.tanh(s.qd / TURN), s.wrench)
    return pipeline.events


def during(begin, end, value):
    return lambda t: np.where((t > begin) & (t < end), 1.0, 0.0)[:, None] * np.asarray(value)


def test_friction_makes_no_events(arm):
    assert len(events(arm, FRICTION)) <= 1  # of some 30 turns


def test_joints_that_turn_during_a_push_make_no_second_contact(arm):
    found = events(arm, FRICTION, push=during(3.0, 4.5, [0.0, 15.0, 0.0]))
    (own,) = (event for event in found if 2.9 < event.detected < 4.7)
    assert own.status == tl.Status.LOCATED and own.link == "panda_link6"
    assert own.cleared is not None and own.cleared < 4.7


def test_an_arm_without_friction_still_tells_of_a_torque_on_one_joint(arm):
    found = events(arm, 0.0, torque=lambda t: during(3.0, 4.0, [1.0])(t)[:, 0])
    assert any(2.99 < event.detected < 3.1 for event in found)


def test_what_begins_as_friction_does_names_no_link_surely():
    """With torques alone friction that turns is an event; a link had been named with 1.0."""
    found = events(load_arm("panda-torques", 1), FRICTION)
    assert len(found) > 2
    assert all(c.probability <= 0.5 for event in found for c in event.candidates)


def setting_off(arm, at, seconds):
    """Every joint stands until `at` [s], then goes to and fro, each at a pace of its own."""
    n = len(arm.joint_names)
    way = swaying(n, 0.6, 0.8, 1.4)
    way = replace(way, center=way.center - np.eye(n)[3] * 1.5, phase=0.0 * way.phase)

    def path(time):
        s = np.maximum(time - at, 0.0)
        rest = np.exp(-4.0 * s)  # it sets off without a jerk
        pace, more = 1.0 - (1.0 + 4.0 * s) * rest, 16.0 * s * rest
        q, qd, qdd = way(s - 0.5 + (0.5 + s) * rest)
        return q, qd * pace[:, None], qdd * pace[:, None] ** 2 + qd * more[:, None]

    maker = MotionMaker(arm, arm, RATE, seconds)
    return maker, *maker.loads(path)


def test_without_a_sensor_friction_shows_by_turns():
    """At rest nothing is off, and what its motion shows had been a touch that never ended."""
    arm = load_arm("panda-torques", 1)
    maker, q, qd, loads = setting_off(arm, 1.0, 20.0)
    s = maker.sensed(q, qd, loads, np.random.default_rng(1))
    (event,) = felt(arm, s, FRICTION)  # of the first turns: then its friction is known
    assert event.cleared is not None and event.cleared - event.detected < 3.0
    assert event.body is None


def test_a_push_on_friction_that_is_known_is_felt():
    arm = load_arm("panda-torques", 1)
    maker, q, qd, loads = setting_off(arm, 1.0, 16.0)
    press(arm, q, loads, during(10.0, 10.6, [0.0, 20.0, 0.0])(maker.time))
    s = maker.sensed(q, qd, loads, np.random.default_rng(1))
    _, event = felt(arm, s, FRICTION)
    assert 10.0 < event.detected < 10.05
    assert event.cleared is not None and 10.6 < event.cleared < 10.9


def test_of_slow_samples_joints_that_turn_between_two_are_no_pushes():
    """At 15 Hz a joint is quick again with the first sample after its turn: it was 15 events."""
    arm, slow = load_arm("panda-torques", 1), slice(None, None, 33)
    n = len(arm.joint_names)
    way = swaying(n, 0.3, 3.0, 5.0)
    maker = MotionMaker(arm, arm, RATE, 19.0)
    q, qd, loads = maker.loads(replace(way, center=way.center - np.eye(n)[3] * 1.5))
    s = maker.sensed(q, qd, loads, np.random.default_rng(2)).where(slow)
    pipeline = tl.Pipeline(arm, period=33.0 / RATE)
    pipeline.run(s.time, s.q, s.qd, s.tau + 2.0 * np.tanh(s.qd / TURN), s.wrench)
    assert len(pipeline.events) <= 3
    assert all(e.cleared is not None and e.cleared - e.detected < 0.3 for e in pipeline.events)


def test_pushes_against_an_arm_that_turns_are_no_friction():
    """On an arm as told, at each stroke of its second joint: each lasts until it is let go."""
    arm = load_arm("panda-torques", 1)
    maker, q, qd, loads = setting_off(arm, 1.0, 20.0)
    quick = np.abs(qd[:, 1]) > 0.4
    begins = np.flatnonzero(quick[1:] & ~quick[:-1])[1:-1]
    assert len(begins) >= 4
    spells = [(maker.time[i], maker.time[i] + 0.4) for i in begins]
    for i, (begin, end) in zip(begins, spells, strict=True):
        loads[:, 1] += 5.0 * np.sign(qd[i, 1]) * ((maker.time > begin) & (maker.time < end))
    s = maker.sensed(q, qd, loads, np.random.default_rng(1))
    found = [(e.detected, e.cleared) for e in felt(arm, s, 0.0)]
    assert len(found) == len(spells)
    for (begin, end), (detected, cleared) in zip(spells, found, strict=True):
        assert begin < detected < begin + 0.05
        assert end < cleared < end + 0.3
