# SPDX-License-Identifier: Apache-2.0
"""Spots told by the direction of joint torques: known ones, and none of them."""

import numpy as np
import pytest

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.model.description import TaughtTouch
from touchline.touch.spot import TorqueSpots, lever_arms

Q = (0.3, 0.4, 0.0, -1.2, 0.1, 0.8, 0.0)


@pytest.fixture(scope="module")
def skin():
    return Skin(tl.load_robot("sara"))


def taught(direction, rng, count=3, q=Q):
    steps = [rng.uniform(3, 10) * (direction + 0.01 * rng.normal(size=7)) for _ in range(count)]
    return [TaughtTouch(q, tuple(step)) for step in steps]


@pytest.fixture
def spots(skin):
    rng = np.random.default_rng(1)
    one, two = np.array([0.8, 0, 0.6, 0, 0, 0, 0]), np.array([0, 0.9, 0, 0.44, 0, 0, 0])
    return TorqueSpots({"one": taught(one, rng), "two": taught(two, rng)}, skin)


@pytest.mark.parametrize("size", [2.0, 20.0])
def test_a_spot_is_told_whatever_the_force(spots, size):
    name, probability = spots.read(np.array(Q), size * np.array([0.8, 0, 0.6, 0, 0, 0, 0]))[0]
    assert name == "one" and probability > 0.95


@pytest.mark.parametrize(
    "step", [[-8, 0, -6, 0, 0, 0, 0], [0, 0, 0, 5, 0, 2, 0], [0, 8, 0, -4, 0, 0, 0], [0.1] * 7]
)
def test_other_touches_are_none_of_them(spots, step):
    assert spots.read(np.array(Q), np.array(step, float))[0][0] is None


def test_in_another_posture_nothing_is_told(spots):
    assert spots.read(np.array(Q) + 0.5, np.array([8.0, 0, 6, 0, 0, 0, 0])) == [(None, 1.0)]


def test_a_joint_without_a_torque_is_left_out(spots):
    step = np.array([8.0, 0, 6, 0, 0, 0, np.nan])
    assert spots.read(np.array(Q), step)[0][0] == "one"


def test_lever_arms_shrink_outwards(skin):
    levers = lever_arms(skin, np.array(Q))
    assert 0.05 <= levers[-1] < levers[3] < levers[1] < 1.5
