# SPDX-License-Identifier: Apache-2.0
"""Events do not depend on the parts in which a recording is read."""

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.observer.dynamics import contact_loads


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def touched(robot):
    """Two segments are touched in turns; each touch ends before the recording does."""
    samples = free_motion(robot, seconds=3.0, rate=200.0)
    for link, start in (("link3", 100), ("tool", 160), ("link3", 260), ("tool", 400)):
        rows, push = slice(start, start + 40), [0.0, 12.0, 0.0, 0.0, 0.0, 0.0]
        loads = contact_loads(robot, samples.q[rows], link, push)
        samples.tau[rows] -= loads.torque
        samples.wrench[rows] -= loads.wrench
    return samples


def events_in_parts(robot, samples, rows):
    pipeline = tl.Pipeline(robot, period=0.005)
    for start in range(0, len(samples), rows):
        part = slice(start, start + rows)
        pipeline.run(
            samples.time[part],
            samples.q[part],
            samples.qd[part],
            samples.tau[part],
            samples.wrench[part],
        )
    return [(e.id, e.segment, e.detected, e.cleared, e.level, e.joint) for e in pipeline.events]


@pytest.mark.parametrize("rows", [1, 7, 100])
def test_events_are_the_same(robot, touched, rows):
    whole = events_in_parts(robot, touched, len(touched))
    assert events_in_parts(robot, touched, rows) == whole
    assert len(whole) >= 4 and all(cleared is not None for _, _, _, cleared, *_ in whole)


def test_events_are_numbered_in_the_order_of_detection(robot, touched):
    events = events_in_parts(robot, touched, len(touched))
    detected = [event[2] for event in events]
    assert detected == sorted(detected)
    assert [event[0] for event in events] == list(range(len(events)))


def test_an_event_may_end_with_the_first_sample_of_a_part(robot, touched):
    cleared = events_in_parts(robot, touched, len(touched))[0][3]
    row = int(np.searchsorted(touched.time, cleared))
    assert events_in_parts(robot, touched, row)[0][3] == cleared
