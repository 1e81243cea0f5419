# SPDX-License-Identifier: Apache-2.0
"""Where a finger is on a slider while a hand elsewhere wavers: exact signals of an arm."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import touchline as tl
from touchline.observer.dynamics import contact_loads
from touchline.touch.slide import STEPS, Slide

Q = np.array([0.3, 0.6, 0.1, -1.2, 0.4, 0.8, 0.2])


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


def shown(robot, link, point, force):
    """What a force in world at a point of a link shows: wrench about the origin, torques."""
    place = robot.places[link]
    T = robot.poses(Q)[place.node] @ place.T_node_link
    x = T[:3, :3] @ point + T[:3, 3]
    loads = contact_loads(robot, Q, link, np.concatenate([force, np.cross(x, force)]))
    return x, np.concatenate([force, np.cross(x, force), loads.torque])


@given(st.floats(0.02, 0.98), st.floats(-1.0, 1.0))
def test_the_way_is_found_although_a_hand_wavers(robot, part, waver):
    place = robot.places["link5"]
    ends = np.array([[0.0, 0.05, -0.15], [0.0, 0.05, 0.0]])
    path = ends[0] + np.linspace(0, 1, STEPS + 1)[:, None] * (ends[1] - ends[0])
    T = place.T_node_link
    slide = Slide(robot, place.node, path @ T[:3, :3].T + T[:3, 3], "base")
    _, finger = shown(robot, "link5", ends[0] + part * (ends[1] - ends[0]), np.array([2, -7, 1.0]))
    hold = np.array([10.0, 0.0, -5.0])
    where, hand = shown(robot, "link3", np.array([0.0, 0.05, 0.0]), waver * hold)
    others = [(robot.places["link3"].node, where, hold, False)]
    way, force = slide.at(robot.poses(Q), finger + hand, others)
    assert way == pytest.approx(part, abs=0.02)
    assert force == pytest.approx([2.0, -7.0, 1.0], abs=0.3)
