# SPDX-License-Identifier: Apache-2.0
"""Which errors a layout cannot tell from contacts."""

import pytest

import touchline as tl
from touchline.check.parity import parity_of
from touchline.trials.recordings import robot_named


def test_with_joint_torques_alone_many_pushes_look_like_an_error_of_the_first_four():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = robot_named("panda")
    parity = parity_of(robot)
    assert parity.pushed == tuple(f"torque of panda_joint{j}" for j in (1, 2, 3, 4))
    assert not parity.tells("torque of panda_joint1")


def test_without_a_sensor_friction_looks_like_an_error_of_any_torque():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    parity = parity_of(robot_named("panda"))
    assert parity.rubbed == tuple(f"torque of panda_joint{j}" for j in range(1, 8))
    assert not parity.tells("torque of panda_joint7")
    assert parity_of(robot_named("ur5")).rubbed == ()
    assert parity_of(tl.load_robot("sara")).rubbed == ()


def test_beside_a_base_sensor_no_push_looks_like_an_error_of_one_joint():
    assert parity_of(tl.load_robot("sara-full")).pushed == ()
