# SPDX-License-Identifier: Apache-2.0
"""Gestures from how fingers press, move and lift."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from touchline.touch.gesture import AGAIN, HOLD, SWIPE, TAP, Finger, GestureReader


def told(*fingers, until=5.0, step=0.005):
    """(kind, time) of all that a reader tells of fingers that begin and lift as they say."""
    reader, found = GestureReader(), []
    ends = {id(f): f.lifted for f in fingers}
    for time in np.arange(0.0, until, step):
        now = []
        for finger in fingers:
            end = ends[id(finger)]
            if finger.begun <= time and (time <= end + step):
                finger.lifted = end if time >= end else None
                now.append(finger)
        found += [(g.kind, g.time) for g in reader.follow(now, time)]
    return found


def press(begun, length, event=0, way=0.0, force=(0.0, 0.0, -5.0), **more):
    first = np.zeros(3)
    return Finger(
        event, begun, "link", "base", np.array(force), 5.0, 5.0, None, first,
        first + [way, 0.0, 0.0], way, begun + length, **more,
    )  # fmt: skip


def kinds(found):
    return [kind for kind, _ in found]


@given(st.floats(0.05, TAP - 0.02))
def test_a_short_press_is_one_tap(length):
    found = told(press(0.5, length))
    assert kinds(found) == ["tap"]
    assert found[0][1] - (0.5 + length) < 0.35


@given(st.floats(0.05, TAP - 0.02), st.floats(0.05, AGAIN - 0.03))
def test_two_short_ones_soon_after_each_other_are_a_double_tap(length, gap):
    assert kinds(told(press(0.5, length), press(0.5 + length + gap, length, 1))) == ["double_tap"]


def test_two_taps_far_apart_are_two():
    assert kinds(told(press(0.5, 0.1), press(1.5, 0.1, 1))) == ["tap", "tap"]


@given(st.floats(TAP + 0.02, HOLD - 0.02))
def test_a_longer_press_is_a_push(length):
    assert kinds(told(press(0.5, length))) == ["push"]


def test_a_hold_is_told_while_it_lasts():
    assert told(press(0.5, 3.0)) == [("hold", 1.5)]


@given(st.floats(SWIPE + 0.005, 0.2), st.floats(0.1, 2.0))
def test_a_finger_that_moves_swipes(way, length):
    assert kinds(told(press(0.5, length, way=way))) == ["swipe"]


def test_two_fingers_against_each_other_are_one_grab():
    hand = press(0.5, 1.5), press(0.55, 1.4, 1, force=(0.0, 0.0, 4.0))
    assert kinds(told(*hand)) == ["grab"]


@given(st.floats(0.02, 2.0), st.floats(0.0, 0.1))
def test_a_blow_is_no_gesture(length, way):
    assert told(press(0.5, length, way=way, collision=True)) == []
