# SPDX-License-Identifier: Apache-2.0
"""What a finger does while a hand elsewhere wavers or lets go: exact signals of an arm."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import touchline as tl
from touchline.observer.dynamics import contact_loads
from touchline.touch.beside import STEPS, WAVER, Beside, Other

Q = np.array([0.3, 0.6, 0.1, -1.2, 0.4, 0.8, 0.2])
HOLD = np.array([10.0, 0.0, -5.0])
ENDS = np.array([[0.0, 0.05, -0.15], [0.0, 0.05, 0.0]])


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


def shown(robot, link, point, force):
    """What a force in world at a point of a link shows: wrench about the origin, torques."""
    place = robot.places[link]
    T = robot.poses(Q)[place.node] @ place.T_node_link
    x = T[:3, :3] @ point + T[:3, 3]
    loads = contact_loads(robot, Q, link, np.concatenate([force, np.cross(x, force)]))
    return np.concatenate([force, np.cross(x, force), loads.torque])


def on_node(robot, link, point):
    T = robot.places[link].T_node_link
    return robot.places[link].node, point @ T[:3, :3].T + T[:3, 3]


def hand_at(robot, spread):
    return Other(*on_node(robot, "link3", np.array([0.0, 0.05, 0.0])), spread)


@given(st.floats(0.02, 0.98), st.floats(-1.0, 1.0))
def test_the_way_is_found_although_a_hand_wavers(robot, part, waver):
    node, path = on_node(
        robot, "link5", ENDS[0] + np.linspace(0, 1, STEPS + 1)[:, None] * (ENDS[1] - ENDS[0])
    )
    finger = shown(robot, "link5", ENDS[0] + part * (ENDS[1] - ENDS[0]), np.array([2, -7, 1.0]))
    hand = shown(robot, "link3", np.array([0.0, 0.05, 0.0]), waver * HOLD)
    others = [hand_at(robot, WAVER * float(np.linalg.norm(HOLD)))]
    way, force = Beside(robot, "base").along(robot.poses(Q), node, path, finger + hand, others)
    assert way == pytest.approx(part, abs=0.02)
    assert force == pytest.approx([2.0, -7.0, 1.0], abs=0.3)


@given(st.floats(0.0, 1.0))
def test_a_hand_that_lets_go_is_no_finger(robot, part):
    node, point = on_node(robot, "link5", ENDS[0] + part * (ENDS[1] - ENDS[0]))
    gone = shown(robot, "link3", np.array([0.0, 0.05, 0.0]), -HOLD)
    others = [hand_at(robot, float(np.linalg.norm(HOLD)))]
    force = Beside(robot, "base").force_at(robot.poses(Q), node, point, gone, others)
    assert np.linalg.norm(force) < 0.1
    mistaken = Beside(robot, "base").force_at(robot.poses(Q), node, point, gone, [])
    assert np.linalg.norm(mistaken) > 3.0
