# SPDX-License-Identifier: Apache-2.0
"""How much the sensors of a robot check each other, and which faults nothing can tell.

With a contact at the outboard end of every segment the measured residuals are y = A(q) x, with x
the segments' wrenches. What is left of y outside the range of A is the parity space: it is zero
whatever touches, and only a fault can fill it.

A contact on another body loads fewer signals. Where it loads fewer than the five that a force at a
place has unknowns, there are many contacts that look like the error of one of these signals.

Where no six-axis sensor checks joint torques, dry friction of one joint looks like an error of its
torque. So no such error is told: real arms have that friction.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Mask
from touchline.model.description import AXES
from touchline.model.robot import Robot

CONFIGURATIONS = 24
VISIBLE = 0.02  # of a unit fault; less is nothing beside noise and model errors
PUSH = 5  # unknowns of a push: its force and its place on a surface


@dataclass(frozen=True)
class Parity:
    """The parity space of a robot.

    Attributes:
        signals: number of measured signals.
        unknowns: components of the segment wrenches that they must explain.
        rank: of the parity space, in a general pose.
        blind: signals whose constant error no pose shows, in words.
        blind_once: signals whose error a single general pose does not show, in words.
        pushed: signals whose error many pushes on one body show as well, in words.
        rubbed: signals whose error friction of a joint shows as well, in words.
    """

    signals: int
    unknowns: int
    rank: int
    blind: tuple[str, ...]
    blind_once: tuple[str, ...]
    pushed: tuple[str, ...]
    rubbed: tuple[str, ...]

    def tells(self, signal: str) -> bool:
        """Can the layout tell an error of this signal from contacts and friction?"""
        return signal not in (*self.blind, *self.pushed, *self.rubbed)


def parity_of(robot: Robot) -> Parity:
    """Rank of the parity space and the single faults that lie outside it."""
    rng = np.random.default_rng(0)
    names = signal_names(robot)
    projections, ranks, pushes = [], [], []
    matrix = np.zeros((0, 0))
    for q in _configurations(robot, rng):
        matrix = response(robot, q)
        projection, rank = _left_null(matrix)
        projections.append(projection)
        ranks.append(rank)
        pushes.append(_pushed(robot, q, matrix))
    rank = int(np.median(ranks))
    once = np.median([np.linalg.norm(p, axis=0) for p in projections], axis=0)
    always = np.max([np.linalg.norm(p, axis=0) for p in projections], axis=0)
    return Parity(
        len(names),
        len(names) - rank,
        rank,
        tuple(name for name, seen in zip(names, always, strict=True) if seen < VISIBLE),
        tuple(name for name, seen in zip(names, once, strict=True) if seen < VISIBLE),
        tuple(name for name, like in zip(names, np.all(pushes, axis=0), strict=True) if like),
        _rubbed(robot),
    )


def signal_names(robot: Robot) -> list[str]:
    """The measured signals in words."""
    names = [f"torque of {robot.joint_names[j]}" for j in _measured(robot)]
    return names + [f"{s.name}.{axis}" for s in robot.description.sensors for axis in s.axes]


def response(robot: Robot, q: Array) -> Array:
    """A(q) (measured signals, 6 segments): residuals by wrenches in world, about its origin.

    Numbers in N and Nm stand side by side: a metre is the scale of an arm. Each segment is touched
    at its outboard end.
    """
    signals = _Signals(robot, q)
    blocks = [signals.of(_end(robot, name)) for name in robot.segment_names]
    return np.hstack([np.zeros((len(signals.nodes), 0)), *blocks])


class _Signals:
    """What each measured signal shows of a wrench, and at which node it is measured."""

    def __init__(self, robot: Robot, q: Array) -> None:
        self._robot, poses = robot, robot.poses(q)
        starts = {node.sensor: i for i, node in enumerate(robot.nodes) if node.sensor}
        rows, self.nodes = [np.zeros((0, 6))], []
        for j in _measured(robot):
            node = next(i for i, n in enumerate(robot.nodes) if n.joint == robot.joint_names[j])
            rows.append(_joint_row(robot, poses, node)[None, :])
            self.nodes.append(node)
        for name, sensor in zip(robot.sensor_names, robot.description.sensors, strict=True):
            node = starts[name]
            rows.append(_wrench_to_sensor(poses[node])[[AXES.index(axis) for axis in sensor.axes]])
            self.nodes += [node] * len(sensor.axes)
        self._rows = np.vstack(rows)

    def of(self, touched: int) -> Array:
        """(signals, 6): of a wrench on a node, which those outboard of it do not feel."""
        path = _path(self._robot, touched)
        return self._rows * np.array([node in path for node in self.nodes])[:, None]


def _pushed(robot: Robot, q: Array, matrix: Array) -> Mask:
    """Signals (measured signals,) whose error a contact shows, too, on a body that loads few.

    `matrix` is the response at q.
    """
    names, signals = robot.segment_names, _Signals(robot, q)
    found = np.zeros(len(signals.nodes), dtype=bool)
    for body in robot.bodies:
        if body.segment not in names:
            continue
        g = names.index(body.segment)
        touched, block = matrix.copy(), signals.of(body.node)
        touched[:, 6 * g : 6 * g + 6] = block
        sizes = np.linalg.svd(block, compute_uv=False)
        if (sizes > VISIBLE * max(sizes.max(initial=0.0), 1e-12)).sum() >= PUSH:
            continue
        projection, _ = _left_null(touched)
        found |= np.linalg.norm(projection, axis=0) < VISIBLE
    return found


def _rubbed(robot: Robot) -> tuple[str, ...]:
    if any(len(sensor.axes) == len(AXES) for sensor in robot.description.sensors):
        return ()
    return tuple(f"torque of {robot.joint_names[j]}" for j in _measured(robot))


def _measured(robot: Robot) -> list[int]:
    joints = robot.description.joints
    return [j for j, joint in enumerate(joints) if joint.measured]


def _configurations(robot: Robot, rng: np.random.Generator) -> Array:
    return rng.uniform(*robot.ranges, (CONFIGURATIONS, len(robot.joint_names)))


def _left_null(matrix: Array) -> tuple[Array, int]:
    """Orthonormal rows (r, signals) that are zero on the range of the matrix, and r."""
    u, sizes, _ = np.linalg.svd(matrix, full_matrices=True)
    rank = int((sizes > 1e-6 * max(sizes.max(initial=0.0), 1e-12)).sum())
    return u[:, rank:].T, matrix.shape[0] - rank


def _path(robot: Robot, node: int) -> list[int]:
    path = []
    while node >= 0:
        path.append(node)
        node = robot.nodes[node].parent
    return path


def _end(robot: Robot, segment: str) -> int:
    """The most outboard body of a segment."""
    own = [body.node for body in robot.bodies if body.segment == segment]
    if not own:
        return next(i for i, node in enumerate(robot.nodes) if node.sensor == segment)
    return max(own, key=lambda node: len(_path(robot, node)))


def _joint_row(robot: Robot, poses: Array, node: int) -> Array:
    axis, origin = poses[node][:3, 2], poses[node][:3, 3]
    if robot.nodes[node].kind == "prismatic":
        return np.hstack([axis, np.zeros(3)])
    return np.hstack([np.cross(origin, axis), axis])


def _wrench_to_sensor(T: Array) -> Array:
    """(6, 6): a wrench in world about its origin, in the sensor's frame about its origin."""
    R, p = T[:3, :3], T[:3, 3]
    lever = np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
    matrix = np.zeros((6, 6))
    matrix[:3, :3] = matrix[3:, 3:] = R.T
    matrix[3:, :3] = -R.T @ lever
    return matrix
