# SPDX-License-Identifier: Apache-2.0
"""Momentum and n-bar of every row against Pinocchio with the sensors as free joints."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from oracle import PinocchioTwin
from robots import load_example, random_robot

import touchline
from touchline.model.description import SensorDescription
from touchline.model.robot import Robot

STATES = 300


def check_against_pinocchio(robot, seed=0):
    twin = PinocchioTwin(robot.description, robot.mechanism)
    rng = np.random.default_rng(seed)
    n = len(robot.joint_names)
    for _ in range(STATES):
        q, qd = rng.uniform(-3, 3, n), rng.normal(size=n) * 2
        p, n_bar = robot.terms(q, qd)
        p_twin, n_twin = twin.terms(q, qd)
        np.testing.assert_allclose(p, p_twin, rtol=1e-9, atol=1e-9 * np.abs(p_twin).max())
        np.testing.assert_allclose(n_bar, n_twin, rtol=1e-9, atol=1e-9 * np.abs(n_twin).max())


@pytest.mark.parametrize("seed", range(8))
def test_random_trees_agree_with_pinocchio(seed):
    check_against_pinocchio(random_robot(seed, sensors=2 + seed % 3, chain=seed % 2 == 0))


def test_the_oracle_factorises_the_inertia_rate():
    robot = random_robot(3)
    twin = PinocchioTwin(robot.description, robot.mechanism)
    rng = np.random.default_rng(1)
    q, qd = rng.normal(size=7), rng.normal(size=7)
    position, velocity = twin.state(q, qd)
    step = 1e-6
    ahead = twin.mass_matrix(pin.integrate(twin.model, position, velocity * step))
    behind = twin.mass_matrix(pin.integrate(twin.model, position, -velocity * step))
    C = pin.computeCoriolisMatrix(twin.model, twin.data, position, velocity)
    np.testing.assert_allclose((ahead - behind) / (2 * step), C + C.T, atol=1e-7)


def test_momentum_is_linear_in_the_velocity():
    robot = random_robot(5)
    rng = np.random.default_rng(2)
    q, a, b = rng.normal(size=(3, 7))
    momenta = [robot.terms(q, qd)[0] for qd in (a, b, a + 3 * b)]
    np.testing.assert_allclose(momenta[2], momenta[0] + 3 * momenta[1], atol=1e-12)


def with_base_sensor(robot):
    """The same robot with one more sensor, under its first link that has mass."""
    link = next(name for name, link in robot.mechanism.links.items() if link.inertia.mass > 0)
    base = SensorDescription("under_base", link, (0.02, -0.01, 0.03), (0.4, 0.2, -0.3))
    sensors = (base, *robot.description.sensors)
    bandwidths = {**robot.description.bandwidth_sensors, "under_base": 100.0}
    description = replace(robot.description, sensors=sensors, bandwidth_sensors=bandwidths)
    return Robot(description, robot.mechanism)


@pytest.mark.parametrize("name", ["panda_wrist_ft", "panda_hand", "ur10e", "kinova_gen3"])
def test_real_arms_agree_with_pinocchio(name):
    check_against_pinocchio(with_base_sensor(load_example(name)))


@pytest.mark.parametrize("name", ["sara", "sara-full"])
def test_shipped_arms_agree_with_pinocchio(name):
    check_against_pinocchio(touchline.load_robot(name))


@pytest.mark.parametrize("turns", [1, 1000, 15000, 20000, 100000])  # with both kinds of reduction
def test_whole_turns_change_nothing(turns):
    robot = random_robot(2, chain=True)
    rng = np.random.default_rng(3)
    q = np.where([node.kind == "revolute" for node in robot.nodes if node.joint], 1.0, 0.0)
    for _ in range(50):
        small, qd = rng.uniform(-np.pi, np.pi, 7), rng.normal(size=7)
        near = robot.terms(small, qd)
        for sign in (1, -1):
            far = robot.terms(small + sign * 2 * np.pi * turns * q, qd)
            np.testing.assert_allclose(far[0], near[0], atol=1e-12 * turns + 1e-11)
            np.testing.assert_allclose(far[1], near[1], atol=1e-12 * turns + 1e-11)
