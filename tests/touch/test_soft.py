# SPDX-License-Identifier: Apache-2.0
"""Touches that the detector does not feel: told while the arm stands, and nothing else is."""

import numpy as np
import pytest
from surface import place_on, torques

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.model.description import TaughtTouch
from touchline.touch.soft import SoftTouch
from touchline.touch.spot import TorqueSpots

Q = np.array([0.3, 0.4, 0.0, -1.2, 0.1, 0.8, 0.0])
PERIOD, NOISE = 0.002, 0.1  # s, Nm
BEGIN, END = 1.0, 1.4  # s, of a touch


@pytest.fixture(scope="module")
def step():
    """Of the touches that teach [Nm]."""
    skin = Skin(tl.load_robot("sara"))
    return torques(skin.robot, Q, "link4", *place_on(skin, "link4", np.random.default_rng(3)))


@pytest.fixture(scope="module")
def spots(step):
    skin = Skin(tl.load_robot("sara"))
    size = 3.0 / np.linalg.norm(step)
    return TorqueSpots({"spot": [TaughtTouch(tuple(Q), tuple(size * step))] * 3}, skin)


def told(spots, step, speed=0.0, felt=False, offset=0.0):
    """What is told of one step (n,) [Nm] at the given joint speed [rad/s]."""
    rng, soft, found = np.random.default_rng(0), SoftTouch(spots), []
    for time in np.arange(0.0, 2.0, PERIOD):
        torque = offset + NOISE * rng.normal(size=7) + step * (BEGIN < time < END)
        q = Q + speed * (time - BEGIN)
        found.append((time, soft.follow(float(time), q, torque, felt)))
    return [(time, *what) for time, what in found if what is not None]


@pytest.mark.parametrize("newton_metres", [1.6, 3.0, 12.0])
@pytest.mark.parametrize("offset", [0.0, 2.0])
def test_a_soft_touch_of_a_taught_spot_is_told_once(spots, step, newton_metres, offset):
    events = told(spots, newton_metres * step / np.linalg.norm(step), offset=offset)
    assert [event[1:3] for event in events] == [("press", "spot"), ("release", "spot")]
    assert BEGIN < events[0][0] < BEGIN + 0.25 and END < events[1][0] < END + 0.2
    assert 0.5 <= events[0][3] <= 1.0


def test_what_is_softer_than_half_of_the_softest_lesson_was_not_meant(spots, step):
    assert told(spots, 1.2 * step / np.linalg.norm(step)) == []


def test_a_touch_elsewhere_is_not_told(spots, step):
    assert told(spots, -step * 3.0 / np.linalg.norm(step)) == []


@pytest.mark.parametrize("speed", [0.03, 0.3])
def test_an_arm_that_moves_tells_nothing(spots, step, speed):
    assert told(spots, 3.0 * step / np.linalg.norm(step), speed) == []


def test_what_the_detector_feels_is_left_to_it(spots, step):
    assert told(spots, 3.0 * step / np.linalg.norm(step), felt=True) == []
