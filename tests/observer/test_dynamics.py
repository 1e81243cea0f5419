# SPDX-License-Identifier: Apache-2.0
"""The baselines' dynamics against Pinocchio with the sensors as free joints."""

import numpy as np
import pinocchio as pin
import pytest
from oracle import PinocchioTwin
from robots import describe, random_mechanism, random_robot

from touchline.model.description import JointDescription
from touchline.model.mechanism import Mimic
from touchline.model.robot import Robot
from touchline.observer.dynamics import (
    contact_loads,
    coriolis_matrix,
    gravity_loads,
    inverse_dynamics,
    mass_matrix,
    point_jacobian,
    posture,
)

STATES = 40
SEEDS = range(6)


def rows(loads):
    wrench = loads.wrench.reshape(*loads.torque.shape[:-1], -1)
    return np.concatenate([loads.torque, wrench], axis=-1)


def case(seed):
    robot = random_robot(seed, sensors=2 + seed % 3, chain=seed % 2 == 0)
    rng = np.random.default_rng(seed + 100)
    q, qd, qdd = rng.normal(size=(3, STATES, 7)) * np.array([2.0, 2.0, 5.0])[:, None, None]
    return robot, PinocchioTwin(robot.description, robot.mechanism), q, qd, qdd


def assert_close(ours, theirs):
    np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())


@pytest.mark.parametrize("seed", SEEDS)
def test_newton_euler_agrees_with_pinocchio(seed):
    robot, twin, q, qd, qdd = case(seed)
    theirs = np.array([twin.loads(*state) for state in zip(q, qd, qdd, strict=True)])
    assert_close(rows(inverse_dynamics(robot, q, qd, qdd)), theirs)


@pytest.mark.parametrize("seed", SEEDS)
def test_mass_matrix_agrees_with_pinocchio(seed):
    robot, twin, q, _, _ = case(seed)
    M, M_vq = mass_matrix(robot, q)
    order = twin.rows()
    for i in range(STATES):
        whole = twin.mass_matrix(twin.state(q[i], np.zeros(7))[0])[np.ix_(order, order[:7])]
        assert_close(M[i], whole[:7])
        assert_close(M_vq[i].reshape(-1, 7), whole[7:])


@pytest.mark.parametrize("seed", SEEDS)
def test_gravity_and_both_coriolis_products_agree_with_pinocchio(seed):
    robot, twin, q, qd, _ = case(seed)
    C, g = coriolis_matrix(robot, q, qd), rows(gravity_loads(robot, q))
    joints = twin.rows()[:7]
    for i in range(STATES):
        position, velocity = twin.state(q[i], qd[i])
        theirs = pin.computeCoriolisMatrix(twin.model, twin.data, position, velocity).copy()
        weight = pin.computeGeneralizedGravity(twin.model, twin.data, position).copy()
        assert_close(C[i] @ qd[i], (theirs @ velocity)[joints])
        assert_close(C[i].T @ qd[i], (theirs.T @ velocity)[joints])
        assert_close(g[i], weight[twin.rows()])


@pytest.mark.parametrize("seed", SEEDS)
def test_the_inertia_rate_is_the_coriolis_matrix_and_its_transpose(seed):
    robot, _, q, qd, _ = case(seed)
    step = 1e-6
    rate = (mass_matrix(robot, q + step * qd)[0] - mass_matrix(robot, q - step * qd)[0]) / step / 2
    C = coriolis_matrix(robot, q, qd)
    np.testing.assert_allclose(rate, C + np.swapaxes(C, -1, -2), atol=1e-6)


def test_postures_are_those_of_the_native_core():
    robot, _, q, _, _ = case(1)
    placed = posture(robot, q)
    native = np.array([robot.poses(x) for x in q])
    np.testing.assert_allclose(np.stack(placed.rotation, 1), native[..., :3, :3], atol=1e-12)
    np.testing.assert_allclose(np.stack(placed.origin, 1), native[..., :3, 3], atol=1e-12)


def test_one_instant_and_many_give_the_same_numbers():
    robot, _, q, qd, qdd = case(2)
    many = rows(inverse_dynamics(robot, q, qd, qdd))
    one = rows(inverse_dynamics(robot, q[3], qd[3], qdd[3]))
    np.testing.assert_allclose(many[3], one, rtol=1e-12, atol=1e-12)
    assert mass_matrix(robot, q[3])[1].shape == (len(robot.sensor_names), 6, 7)


def test_a_contact_loads_what_the_jacobian_says():
    robot, twin, q, _, _ = case(4)
    force, point = np.array([3.0, -5.0, 7.0]), np.array([0.2, 0.1, -0.3])
    wrench = np.r_[force, np.cross(point, force)]
    carrier = robot.nodes[robot.places["link5"].node]
    name = carrier.sensor or carrier.joint
    theirs = np.array([force @ twin.jacobian_world(x, name, point) for x in q])
    assert_close(rows(contact_loads(robot, q, "link5", wrench)), theirs)


def test_the_jacobian_of_a_point_is_its_velocity():
    robot, _, q, qd, _ = case(0)
    local, step = np.array([0.1, -0.2, 0.05, 1.0]), 1e-6

    def pose(i, sign):
        return robot.T_world_links(q[i] + sign * step * qd[i])["plate6"]

    J = point_jacobian(robot, q, "plate6", local[:3])
    for i in range(5):
        ahead, behind = pose(i, 1), pose(i, -1)
        linear = ((ahead - behind) @ local)[:3] / (2 * step)
        turn = (ahead - behind)[:3, :3] / (2 * step) @ robot.T_world_links(q[i])["plate6"][:3, :3].T
        angular = np.array([turn[2, 1], turn[0, 2], turn[1, 0]])
        np.testing.assert_allclose(J[i] @ qd[i], np.r_[linear, angular], atol=1e-6)


def test_joints_that_mimic_move_with_their_master():
    """Momentum and n-bar by matrices against the native recursion, which uses neither."""
    mechanism = random_mechanism(np.random.default_rng(8))
    follower = mechanism.joints["joint6"]
    mechanism.joints["joint6"] = type(follower)(
        **{**follower.__dict__, "mimic": Mimic("joint2", -1.5, 0.3)}
    )
    observed = tuple(JointDescription(f"joint{i}") for i in (1, 2, 3, 4, 5, 7))
    robot = Robot(describe(mechanism, [("base", "link0")], joints=observed), mechanism)
    q, qd = np.random.default_rng(2).normal(size=(2, 6))
    p, n_bar = robot.terms(q, qd)
    assert_close(mass_matrix(robot, q)[0] @ qd, p[:6])
    weight = gravity_loads(robot, q).torque
    assert_close(weight - coriolis_matrix(robot, q, qd).T @ qd, n_bar[:6])
