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
    assert not parity.tells("torque of panda_joint1") and parity.tells("torque of panda_joint5")


def test_beside_a_base_sensor_no_push_looks_like_an_error_of_one_joint():
    assert parity_of(tl.load_robot("sara-full")).pushed == ()
