# SPDX-License-Identifier: Apache-2.0
"""Spots told by the direction of joint torques: known ones, and none of them."""

import numpy as np
import pytest
from surface import place_on, torques, wavered

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.model.description import TaughtTouch
from touchline.touch.pushes import Pushes
from touchline.touch.spot import STEP_NOISE, TorqueSpots

Q = np.array([0.3, 0.4, 0.0, -1.2, 0.1, 0.8, 0.0])
LINKS = ("link3", "link4", "link5")


@pytest.fixture(scope="module")
def skin():
    return Skin(tl.load_robot("sara"))


@pytest.fixture(scope="module")
def hand(skin):
    """Torque steps (n,) of a hand that pushes a place again and again, with noise."""

    def again(place, rng, newtons):
        link, point, into = place
        at, force = wavered(point, into, rng)
        step = torques(skin.robot, Q, link, at, newtons * force)
        return step + 0.5 * STEP_NOISE * rng.normal(size=len(Q))

    return again


@pytest.fixture(scope="module")
def places(skin):
    rng = np.random.default_rng(3)
    return {link: (link, *place_on(skin, link, rng)) for link in LINKS}


@pytest.fixture(scope="module")
def taught(places, hand):
    rng = np.random.default_rng(1)
    return {
        name: [TaughtTouch(tuple(Q), tuple(hand(place, rng, 20.0))) for _ in range(3)]
        for name, place in places.items()
    }


@pytest.fixture(scope="module")
def spots(taught, skin):
    return TorqueSpots(taught, skin)


@pytest.mark.parametrize("newtons", [8.0, 40.0])
def test_spots_are_told_whatever_the_force(spots, places, hand, newtons):
    rng = np.random.default_rng(2)
    told = [
        spots.read(Q, hand(place, rng, newtons))[0][0] == name
        for name, place in places.items()
        for _ in range(20)
    ]
    assert np.mean(told) >= 0.95


def test_touches_elsewhere_are_none_of_them(spots, skin, hand):
    rng = np.random.default_rng(4)
    told = []
    for _ in range(100):
        link = str(rng.choice(LINKS))
        told.append(spots.read(Q, hand((link, *place_on(skin, link, rng)), rng, 10.0))[0][0])
    assert np.mean([name is None for name in told]) >= 0.9  # some are where a spot was taught


def test_a_pull_is_no_push(spots, places, hand):
    rng = np.random.default_rng(5)
    for place in places.values():
        assert spots.read(Q, -hand(place, rng, 10.0))[0][0] is None


def test_too_little_has_no_direction(spots):
    assert spots.read(Q, np.full(7, 0.1)) == [(None, 1.0)]


def test_in_another_posture_nothing_is_told(spots, places, hand):
    step = hand(places["link4"], np.random.default_rng(0), 10.0)
    assert spots.read(Q + 0.5, step) == [(None, 1.0)]
    assert spots.least(Q + 0.5) == np.inf and 0.3 < spots.least(Q) < 20.0


def test_a_joint_without_a_torque_is_left_out(spots, places, hand):
    step = hand(places["link4"], np.random.default_rng(0), 10.0)
    step[-1] = np.nan
    assert spots.read(Q, step)[0][0] == "link4"


def test_one_touch_teaches_less_than_three(taught, skin, places, hand):
    once = TorqueSpots({name: touches[:1] for name, touches in taught.items()}, skin)
    thrice = TorqueSpots(taught, skin)
    rng, sure = np.random.default_rng(6), []
    for _ in range(20):
        step = hand(places["link5"], rng, 10.0)
        sure.append([dict(spots.read(Q, step)).get("link5", 0.0) for spots in (once, thrice)])
    assert np.mean(sure, axis=0)[0] < np.mean(sure, axis=0)[1]


def test_a_direction_that_no_push_brings_may_still_be_taught(skin):
    odd = TorqueSpots({"odd": [TaughtTouch(tuple(Q), (0, 0, 0, 0, 0, 0, 5.0))] * 3}, skin)
    assert odd.read(Q, np.array([0, 0, 0, 0, 0, 0, 8.0]))[0][0] == "odd"


@pytest.fixture(scope="module")
def pushes(skin):
    return Pushes(skin, Q, np.full(7, True))


def test_what_pushes_bring_is_likelier_than_any_direction(pushes, skin):
    rng = np.random.default_rng(7)
    brought, any_way = [], rng.normal(size=(200, 7))
    for _ in range(200):
        link = str(rng.choice(LINKS))
        point, into = place_on(skin, link, rng)
        brought.append(torques(skin.robot, Q, link, point, into))
    logs = [
        [pushes.directions.log_density(step / np.linalg.norm(step), 0.01) for step in steps]
        for steps in (brought, any_way)
    ]
    assert np.quantile(logs[0], 0.05) > np.quantile(logs[1], 0.9)


def test_wavering_is_what_a_wavering_hand_shows(pushes, skin):
    """One spread for the direction of the force and one for the place, over likely pushes."""
    rng = np.random.default_rng(8)
    for link in LINKS:
        point, into = place_on(skin, link, rng)
        step = torques(skin.robot, Q, link, point, into)
        middle = step / np.linalg.norm(step)
        spreads = pushes.wavering(middle, 0.005)
        for spread, (direction, place) in zip(spreads, ((0.02, 0.0), (0.0, 0.002)), strict=True):
            units = np.array([
                torques(skin.robot, Q, link, *wavered(point, into, rng, direction, place))
                for _ in range(300)
            ])  # fmt: skip
            units /= np.linalg.norm(units, axis=1, keepdims=True)
            seen = np.sqrt(np.trace(np.cov(units.T)))
            said = (direction + place) * np.sqrt(np.trace(spread))
            assert seen / 2 < said < 2 * seen
