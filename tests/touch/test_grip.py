# SPDX-License-Identifier: Apache-2.0
"""A hand that closes is told from a finger that eases, slides or lifts."""

import numpy as np
import pytest

from touchline.touch.grip import Grip

DOWN = np.array([0.0, 0.0, -1.0])


def wrench(*forces):
    """Of (point, force) pairs, about the origin."""
    return sum(np.concatenate([f, np.cross(p, f)]) for p, f in forces)


def watched(at):
    """The largest miss while `at(time)` gives (wrench, felt place)."""
    grip, most = Grip(), 0.0
    for time in np.arange(0.0, 1.0, 0.001):
        if grip.due(time):
            most = max(most, grip.follow(time, *at(time)))
    return most


@pytest.mark.parametrize("aside", [0.01, 0.03])
@pytest.mark.parametrize("share", [0.4, 0.8])
def test_fingers_on_the_other_side_are_a_hand(aside, share):
    thumb, back = np.array([0.02, 0.01, 0.05]), np.array([0.02 + aside, 0.01, -0.05])

    def at(time):
        closed = np.clip((time - 0.1) / 0.04, 0.0, 1.0)
        return wrench((thumb, 10 * DOWN), (back, -10 * share * closed * DOWN)), thumb

    assert watched(at) == pytest.approx(aside, abs=1e-6)


def test_a_finger_that_eases_is_no_hand():
    place = np.array([0.02, 0.01, 0.05])

    def at(time):
        force = 10 - 6 * np.clip((time - 0.2) / 0.1, 0.0, 1.0)
        drag = np.array([0.3, 0.0, 0.0]) * (time > 0.25)  # and that begins to drag
        return wrench((place, force * (DOWN + drag))), place

    assert watched(at) == 0.0


def test_a_finger_that_slides_and_eases_is_no_hand():
    def at(time):
        place = np.array([0.1 * time, 0.0, 0.05])
        return wrench((place, (10 - 5 * time) * DOWN)), place

    assert watched(at) == 0.0


def test_a_finger_that_lifts_is_no_hand():
    place = np.array([0.02, 0.01, 0.05])

    def at(time):
        rest = np.array([0.0, 0.0, 0.0, 0.01, 0.0, 0.0])  # what an offset leaves
        return wrench((place, 10 * (time < 0.3) * DOWN)) + rest + 1e-3, place

    assert watched(at) == 0.0


def test_another_touch_far_away_is_no_hand():
    one, other = np.array([0.0, 0.0, 0.05]), np.array([0.4, 0.0, -0.05])

    def at(time):
        return wrench((one, 10 * DOWN), (other, -6 * (time > 0.2) * DOWN)), one

    assert watched(at) == 0.0
