# SPDX-License-Identifier: Apache-2.0
"""Rigid-body dynamics over a robot's nodes, in plain numpy: for the baselines, not for speed.

The native observer needs no mass matrix, no Coriolis matrix and no acceleration; the classical
methods need all three. This module shares no code with the native core, so the two check each
other. All functions take one instant or any number in front: q (n,) or (N, n).

Inside, all twists and wrenches are in world axes about the world's origin, where a body's load
simply adds to its parent's; `[linear; angular]` and `[force; moment]`.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.model.tree import Node

AHEAD, BEHIND = np.array([1, 2, 0]), np.array([2, 0, 1])  # axes after and before each


@dataclass(frozen=True)
class Loads:
    """Generalized forces of all rows.

    Attributes:
        torque: joint torques (..., n) [Nm or N].
        wrench: wrench (..., k, 6) [N, Nm] that each sensor exerts on what is outboard of it, in
            the sensor frame about its origin (outboard polarity).
    """

    torque: Array
    wrench: Array


@dataclass(frozen=True)
class Posture:
    """Where the nodes are: rotations (..., 3, 3), origins (..., 3), motion subspaces (..., 6).

    A subspace is the twist that one unit of the joint's velocity causes, in world axes about the
    world's origin; a node that does not move has zeros.
    """

    rotation: list[Array]
    origin: list[Array]
    subspace: list[Array]


def posture(robot: Robot, q: ArrayLike) -> Posture:
    """Forward kinematics of all nodes for joint positions `q` (..., n) [rad or m]."""
    q = np.asarray(q, dtype=float)
    placed = Posture([], [], [])
    for node in robot.nodes:
        R, p = node.T_parent_node[:3, :3], node.T_parent_node[:3, 3]
        if node.parent >= 0:
            R_parent = placed.rotation[node.parent]
            R, p = R_parent @ R, placed.origin[node.parent] + R_parent @ p
        lead = q.shape[:-1]
        R, p = np.broadcast_to(R, (*lead, 3, 3)), np.broadcast_to(p, (*lead, 3))
        R, p, S = _moved(node, R, p, q)
        placed.rotation.append(R)
        placed.origin.append(p)
        placed.subspace.append(S)
    return placed


def inverse_dynamics(
    robot: Robot, q: ArrayLike, qd: ArrayLike, qdd: ArrayLike, gravity: bool = True
) -> Loads:
    """Recursive Newton-Euler: the loads that a motion without contact needs (eq. 1, 7).

    Rotor inertia and friction are not part of it.

    Args:
        robot: the robot.
        q: joint positions (..., n) [rad or m].
        qd: joint velocities (..., n).
        qdd: joint accelerations (..., n).
        gravity: False leaves the weight out.
    """
    return _newton_euler(robot, q, qd, qd, qdd, gravity)


def gravity_loads(robot: Robot, q: ArrayLike) -> Loads:
    """Loads `g(q)` that hold the robot at rest at `q` (..., n)."""
    still = np.zeros(len(robot.joint_names))
    return _newton_euler(robot, q, still, still, still, True)


def mass_matrix(robot: Robot, q: ArrayLike) -> tuple[Array, Array]:
    """The mass matrix and its rows at the sensors, by unit accelerations.

    Returns:
        `M` (..., n, n) of eq. (1), and `M_vq` (..., k, 6, n): what an acceleration of the joints
        loads onto the sensors, each in its own frame.
    """
    n = len(robot.joint_names)
    q = np.asarray(q, dtype=float)[..., None, :]
    still = np.zeros(n)
    columns = _newton_euler(robot, q, still, still, np.eye(n), False)
    return np.swapaxes(columns.torque, -1, -2), np.moveaxis(columns.wrench, -3, -1)


def coriolis_matrix(robot: Robot, q: ArrayLike, qd: ArrayLike) -> Array:
    """A Coriolis matrix `C` (..., n, n) with `Mdot = C + C^T`, as `C^T qd` in eq. (3) requires."""
    n = len(robot.joint_names)
    q, qd = (np.asarray(x, dtype=float)[..., None, :] for x in (q, qd))
    columns = _newton_euler(robot, q, qd, np.eye(n), np.zeros(n), False)
    return np.swapaxes(columns.torque, -1, -2)


def contact_loads(robot: Robot, q: ArrayLike, link: str, wrench: ArrayLike) -> Loads:
    """What a wrench on a link contributes to every row: `tau_ext` of eq. (2), for all sensors.

    Args:
        robot: the robot.
        q: joint positions (..., n).
        link: the link that it acts on.
        wrench: (..., 6) [N, Nm] in world axes about the world's origin.
    """
    q, wrench = np.asarray(q, dtype=float), np.asarray(wrench, dtype=float)
    lead = np.broadcast_shapes(q.shape[:-1], wrench.shape[:-1])
    forces = [np.zeros((*lead, 6)) for _ in robot.nodes]
    forces[robot.places[link].node] += wrench
    return _collect(robot, posture(robot, q), forces)


def point_jacobian(robot: Robot, q: ArrayLike, link: str, point: ArrayLike) -> Array:
    """Jacobian `J_c` (..., 6, n) of a point of a link, world axes (eq. 2).

    Args:
        robot: the robot.
        q: joint positions (..., n).
        link: the link that carries the point.
        point: (3,) [m] in the link's frame.
    """
    q = np.asarray(q, dtype=float)
    placed, place = posture(robot, q), robot.places[link]
    local = place.T_node_link[:3, :3] @ np.asarray(point, float) + place.T_node_link[:3, 3]
    J = np.zeros((*q.shape[:-1], 6, q.shape[-1]))
    node = place.node
    while node >= 0:
        if robot.nodes[node].coordinate >= 0:
            J[..., robot.nodes[node].coordinate] += placed.subspace[node]
        node = robot.nodes[node].parent
    world = placed.rotation[place.node] @ local + placed.origin[place.node]
    J[..., :3, :] += np.cross(J[..., 3:, :], world[..., None], axis=-2)
    return J


def to_world(wrench: Array, rotation: Array, origin: Array) -> Array:
    """A wrench (..., 6) in a frame at `origin`, moved to world axes about the world's origin."""
    force = (rotation @ wrench[..., :3, None])[..., 0]
    moment = (rotation @ wrench[..., 3:, None])[..., 0] + cross(origin, force)
    return np.concatenate([force, moment], axis=-1)


def from_world(wrench: Array, rotation: Array, origin: Array) -> Array:
    """Undoes `to_world`."""
    force, moment = wrench[..., :3], wrench[..., 3:] - cross(origin, wrench[..., :3])
    R_inverse = np.swapaxes(rotation, -1, -2)
    return np.concatenate([_turn(R_inverse, force), _turn(R_inverse, moment)], axis=-1)


def _newton_euler(
    robot: Robot, q: ArrayLike, qd: ArrayLike, other: ArrayLike, qdd: ArrayLike, gravity: bool
) -> Loads:
    """Loads of `M qdd + C(q, qd) other + g`; with `other = qd` these are Newton and Euler's.

    With `J_i` the twist of body i by the joints, `C = sum J_i^T (I_i dJ_i + v_i x* I_i J_i)`. In
    world axes `dI/dt = v x* I - I v x`, so this choice satisfies `Mdot = C + C^T`.
    """
    q, qd, other, qdd = (np.asarray(x, dtype=float) for x in (q, qd, other, qdd))
    placed = posture(robot, q)
    twists: list[Array] = []
    others: list[Array] = []
    accelerations: list[Array] = []
    forces: list[Array] = []
    # A frame that accelerates upwards by g feels what gravity would do to it.
    ground = np.r_[-robot.gravity, np.zeros(3)] if gravity else np.zeros(6)
    for i, node in enumerate(robot.nodes):
        inner = node.parent >= 0
        v = twists[node.parent] if inner else np.zeros(6)
        w = others[node.parent] if inner else np.zeros(6)
        a = accelerations[node.parent] if inner else ground
        if node.coordinate >= 0:
            S, j = placed.subspace[i], slice(node.coordinate, node.coordinate + 1)
            v, w = v + S * qd[..., j], w + S * other[..., j]
            a = a + S * qdd[..., j] + _cross_motion(v, S * other[..., j])
        twists.append(v)
        others.append(w)
        accelerations.append(a)
        at = placed.rotation[i], placed.origin[i]
        momentum = _times_inertia(node.inertia, *at, w)
        forces.append(_times_inertia(node.inertia, *at, a) + _cross_force(v, momentum))
    return _collect(robot, placed, forces)


def _collect(robot: Robot, placed: Posture, forces: list[Array]) -> Loads:
    """Sums the bodies' loads from the tips to the root and reads off every row."""
    lead = np.broadcast_shapes(*(f.shape[:-1] for f in forces))
    torque = np.zeros((*lead, len(robot.joint_names)))
    wrench = np.zeros((*lead, len(robot.sensor_names), 6))
    forces = list(forces)
    for i in reversed(range(len(robot.nodes))):
        node = robot.nodes[i]
        if node.coordinate >= 0:  # several nodes where joints mimic one another
            torque[..., node.coordinate] += np.sum(placed.subspace[i] * forces[i], axis=-1)
        if node.sensor is not None:
            row = robot.sensor_names.index(node.sensor)
            wrench[..., row, :] = from_world(forces[i], placed.rotation[i], placed.origin[i])
        if node.parent >= 0:
            forces[node.parent] = forces[node.parent] + forces[i]
    return Loads(torque, wrench)


def _moved(node: Node, R: Array, p: Array, q: Array) -> tuple[Array, Array, Array]:
    """Rotation, origin and subspace of a node after its own joint's motion along or about z."""
    zero = np.zeros_like(p)
    if node.coordinate < 0:
        return R, p, np.concatenate([zero, zero], axis=-1)
    z = R[..., 2]
    position = node.multiplier * q[..., node.coordinate] + node.offset
    if node.kind == "prismatic":
        p = p + z * position[..., None]
        return R, p, node.multiplier * np.concatenate([z, zero], axis=-1)
    c, s = np.cos(position)[..., None], np.sin(position)[..., None]
    x, y = R[..., 0], R[..., 1]
    R = np.stack([c * x + s * y, c * y - s * x, z], axis=-1)
    return R, p, node.multiplier * np.concatenate([cross(p, z), z], axis=-1)


def _times_inertia(body: Inertia, R: Array, p: Array, x: Array) -> Array:
    """Spatial inertia of a body, in world, times a twist or an acceleration (..., 6)."""
    com = _turn(R, body.com) + p
    force = body.mass * (x[..., :3] + cross(x[..., 3:], com))
    spin = _turn(R, _turn(body.inertia, _turn(np.swapaxes(R, -1, -2), x[..., 3:])))
    return np.concatenate([force, cross(com, force) + spin], axis=-1)


def _turn(matrix: Array, vector: Array) -> Array:
    return (matrix @ vector[..., None])[..., 0]


def cross(a: Array, b: Array) -> Array:
    """`a x b` of vectors (..., 3): as `np.cross`, which takes three to five times as long here."""
    return a.take(AHEAD, -1) * b.take(BEHIND, -1) - a.take(BEHIND, -1) * b.take(AHEAD, -1)


def _cross_motion(v: Array, m: Array) -> Array:
    """`v x m` of a twist with a motion: the rate of `m` when it moves with `v`."""
    linear = cross(v[..., 3:], m[..., :3]) + cross(v[..., :3], m[..., 3:])
    return np.concatenate([linear, cross(v[..., 3:], m[..., 3:])], axis=-1)


def _cross_force(v: Array, h: Array) -> Array:
    """`v x* h` of a twist with a momentum or wrench."""
    moment = cross(v[..., :3], h[..., :3]) + cross(v[..., 3:], h[..., 3:])
    return np.concatenate([cross(v[..., 3:], h[..., :3]), moment], axis=-1)
