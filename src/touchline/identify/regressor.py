# SPDX-License-Identifier: Apache-2.0
"""Momentum and n-bar of all rows as linear functions of the bodies' inertial parameters.

A row is a joint, or an axis of a force-torque sensor in its own frame. For a row with the motion
subspace S (6,) in world axes about the world's origin, and a body with momentum H and weight G,

    p = S^T H,    n = -S^T G - Sdot^T H,    Sdot = v x S,

summed over the bodies outboard of it (eqs. 11 and 12). H and G are linear in the body's ten
parameters `m, m c, I` (inertia about the origin of the node's frame, in its axes). Plain numpy, and
no code in common with the native core.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Mask
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.observer.dynamics import Posture, cross, posture

PARAMETERS = 10  # of one body: m, hx, hy, hz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz
_INERTIA_AT = ((0, 1, 2), (1, 3, 4), (2, 4, 5))  # which of the six stands where


@dataclass(frozen=True)
class Rows:
    """The rows of a robot in the order of all arrays: its joints, then six per sensor.

    Attributes:
        names: of the rows, "joint" or "sensor.fx".
        nodes: per row, the nodes that move with it (several where joints mimic each other).
        weightless: per row, is gravity already taken out of the reading?
        silent: per row, is all of the model already taken out?
    """

    names: tuple[str, ...]
    nodes: tuple[tuple[int, ...], ...]
    weightless: Mask
    silent: Mask

    def __len__(self) -> int:
        return len(self.names)


def rows_of(robot: Robot) -> Rows:
    """The rows of a robot, measured or not."""
    names: list[str] = []
    nodes: list[tuple[int, ...]] = []
    taken: list[str] = []
    for j, joint in enumerate(robot.description.joints):
        names.append(joint.name)
        nodes.append(tuple(i for i, node in enumerate(robot.nodes) if node.coordinate == j))
        taken.append(joint.compensated)
    for sensor in robot.description.sensors:
        own = next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor.name)
        for axis in ("fx", "fy", "fz", "mx", "my", "mz"):
            names.append(f"{sensor.name}.{axis}")
            nodes.append((own,))
            taken.append(sensor.compensated)
    weightless = np.array([x == "gravity" for x in taken], dtype=bool)
    return Rows(tuple(names), tuple(nodes), weightless, np.array([x == "model" for x in taken]))


def body_vector(body: Inertia) -> Array:
    """The ten parameters of a body, given in the axes in which they are wanted."""
    c = body.com
    inertia = body.inertia + body.mass * (c @ c * np.eye(3) - np.outer(c, c))
    six = inertia[np.triu_indices(3)]
    return np.concatenate([[body.mass], body.mass * c, six])


def body_of_vector(vector: Array) -> Inertia:
    """The reverse of `body_vector`; a body without mass has its centre at the origin."""
    mass = float(vector[0])
    if mass <= 0.0:
        return Inertia.zero()
    c = vector[1:4] / mass
    inertia = np.empty((3, 3))
    inertia[np.triu_indices(3)] = vector[4:]
    inertia = np.triu(inertia) + np.triu(inertia, 1).T
    return Inertia(mass, c, inertia - mass * (c @ c * np.eye(3) - np.outer(c, c)))


def momentum_regressors(robot: Robot, rows: Rows, q: Array, qd: Array) -> tuple[Array, Array]:
    """Regressors of momentum and of n-bar.

    Args:
        robot: its masses play no part.
        rows: as from `rows_of`.
        q: joint positions (N, n) [rad or m].
        qd: joint velocities (N, n).

    Returns:
        Two arrays (N, rows, nodes, 10): p and n of each row for a unit of each parameter.
    """
    placed = posture(robot, q)
    twists = _twists(robot, placed, qd)
    bodies = [_body_terms(robot, placed, twists, i) for i in range(len(robot.nodes))]
    shape = (len(q), len(rows), len(robot.nodes), PARAMETERS)
    P, B = np.zeros(shape), np.zeros(shape)
    for r, node, S in row_twists(robot, rows, placed):
        if rows.silent[r]:
            continue
        Sdot = _cross_motion(twists[node], S)
        for body in outboard_nodes(robot, node):
            momentum, weight = bodies[body]
            P[:, r, body] += np.einsum("ni,nik->nk", S, momentum)
            B[:, r, body] -= np.einsum("ni,nik->nk", Sdot, momentum)
            if not rows.weightless[r]:
                B[:, r, body] -= np.einsum("ni,nik->nk", S, weight)
    return P, B


def row_twists(robot: Robot, rows: Rows, placed: Posture) -> Iterator[tuple[int, int, Array]]:
    """Each row with a node that moves with it and the motion subspace S (N, 6) of both.

    World axes about the world's origin; a wrench W there on what the node carries adds S^T W.
    """
    joints = len(robot.joint_names)
    for r, nodes in enumerate(rows.nodes):
        for node in nodes:
            joint = r < joints
            S = placed.subspace[node] if joint else _unit_twist(placed, node, (r - joints) % 6)
            yield r, node, S


def outboard_nodes(robot: Robot, node: int) -> list[int]:
    """Numbers of the nodes that move with a node, its own first."""
    inside = {node}
    for i, other in enumerate(robot.nodes):
        if other.parent in inside:
            inside.add(i)
    return sorted(inside)


def _twists(robot: Robot, placed: Posture, qd: Array) -> list[Array]:
    """Twists (N, 6) of the nodes, world axes about the world's origin."""
    twists: list[Array] = []
    for i, node in enumerate(robot.nodes):
        own = np.zeros((len(qd), 6)) if node.parent < 0 else twists[node.parent].copy()
        if node.coordinate >= 0:
            own += placed.subspace[i] * qd[:, node.coordinate, None]
        twists.append(own)
    return twists


def _unit_twist(placed: Posture, node: int, axis: int) -> Array:
    """Twist (N, 6) of unit speed along or about an axis of a node's frame."""
    direction = placed.rotation[node][..., axis % 3]
    if axis < 3:
        return np.concatenate([direction, np.zeros_like(direction)], axis=-1)
    return np.concatenate([cross(placed.origin[node], direction), direction], axis=-1)


def _cross_motion(v: Array, S: Array) -> Array:
    linear = cross(v[:, 3:], S[:, :3]) + cross(v[:, :3], S[:, 3:])
    return np.concatenate([linear, cross(v[:, 3:], S[:, 3:])], axis=1)


def _body_terms(
    robot: Robot, placed: Posture, twists: list[Array], node: int
) -> tuple[Array, Array]:
    """Momentum and weight (N, 6, 10) of a body per unit of its parameters, about the origin."""
    R, p = placed.rotation[node], placed.origin[node]
    count = len(twists[node])
    w = twists[node][:, 3:]
    v = twists[node][:, :3] + cross(w, p)  # of the node's origin
    w_body = np.einsum("nji,nj->ni", R, w)
    linear, angular = np.zeros((count, 3, PARAMETERS)), np.zeros((count, 3, PARAMETERS))
    linear[:, :, 0] = v
    for k in range(3):
        axis = R[:, :, k]
        linear[:, :, 1 + k] = cross(w, axis)
        angular[:, :, 1 + k] = cross(axis, v)
    for six in range(6):
        column = np.zeros((count, 3))
        for a in range(3):
            for b in range(3):
                if _INERTIA_AT[a][b] == six:
                    column[:, a] += w_body[:, b]
        angular[:, :, 4 + six] = np.einsum("nij,nj->ni", R, column)
    g = robot.gravity
    force, moment = np.zeros_like(linear), np.zeros_like(angular)
    force[:, :, 0] = g
    for k in range(3):
        moment[:, :, 1 + k] = cross(R[:, :, k], g)
    return _about_world(p, linear, angular), _about_world(p, force, moment)


def _about_world(p: Array, linear: Array, angular: Array) -> Array:
    moved = angular + np.cross(p[:, :, None], linear, axisa=1, axisb=1, axisc=1)
    return np.concatenate([linear, moved], axis=1)
