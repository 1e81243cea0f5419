# SPDX-License-Identifier: Apache-2.0
"""What a finger does while others touch the arm, too.

A finger at a known place has three unknowns, its force; on a known path a fourth, the way along it.
So what changed since before it landed tells them although a hand elsewhere wavers or lets go. The
way is that for which one force on the path, and changes of the other forces at their places,
explain the change best.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.localizer.localizer import TORQUE_ERROR
from touchline.model.robot import Robot

STEPS = 40  # of a path that are compared; between them a parabola tells
WAVER = 0.3  # of its force, 1 sigma: how much a hand that holds the arm wavers


@dataclass(frozen=True)
class Rows:
    """What one instant shows of all contacts on a segment.

    Attributes:
        wrench: (6,) [N, Nm] on the segment, world axes about the world origin.
        torque: (n,) [Nm] of the joints; NaN where it is not measured or tells of others.
    """

    wrench: Array
    torque: Array

    def values(self) -> Array:
        """All in one (6 + n,)."""
        return np.concatenate([self.wrench, self.torque])


@dataclass(frozen=True)
class Other:
    """Another contact: on `node` at a place (3,) [m] in its frame.

    Attributes:
        spread: how much its force may have changed since before the finger landed, 1 sigma [N].
    """

    node: int
    place: Array
    spread: float


class Beside:
    """Explains what changed on a segment by a finger and by other contacts.

    Args:
        robot: with its noise figures.
        sensor: of the segment, or None.
    """

    def __init__(self, robot: Robot, sensor: str | None) -> None:
        self._robot = robot
        noise = robot.description.noise
        axes = noise.sensors.get(sensor, (1.0,) * 6) if sensor else (1.0,) * 6
        self._noise = np.array([*axes, *noise.tau])

    def force_at(
        self,
        poses: Sequence[Array],
        node: int,
        point: Array,
        change: Array,
        others: Sequence[Other],
    ) -> Array:
        """The force (3,) [N] in world of a finger at a point (3,) [m] of a node's frame.

        Args:
            poses: (4, 4) of all nodes in world.
            node: that carries the point.
            point: see `node`.
            change: (6 + n,) of `Rows.values` since before the finger landed.
            others: what else touches the segment, or did before.
        """
        return self._explained(poses, node, point[None], change, others)[1][0]

    def along(
        self,
        poses: Sequence[Array],
        node: int,
        path: Array,
        change: Array,
        others: Sequence[Other],
    ) -> tuple[float, Array]:
        """The part of the way, 0 to 1, and the force (3,) [N] in world of a finger on a path.

        Args:
            poses: (4, 4) of all nodes in world.
            node: that carries the path.
            path: (STEPS + 1, 3) [m] in the node's frame, at equal distances.
            change: (6 + n,) of `Rows.values` since before the finger landed.
            others: what else touches the segment, or did before.
        """
        cost, force = self._explained(poses, node, path, change, others)
        best = int(np.argmin(cost))
        part = float(best)
        if 0 < best < len(cost) - 1:
            low, middle, high = cost[best - 1 : best + 2].tolist()
            bend = low - 2.0 * middle + high
            part += 0.5 * (low - high) / bend if bend > 0.0 else 0.0
        return part / (len(cost) - 1), force[best]

    def _explained(
        self,
        poses: Sequence[Array],
        node: int,
        path: Array,
        change: Array,
        others: Sequence[Other],
    ) -> tuple[Array, Array]:
        """Misfit (p,), up to a constant, and finger's force (p, 3) for each point of a path."""
        known = np.isfinite(change)
        load = np.abs(np.where(known, change, 0.0))
        load[:6] = 0.0
        sigma = np.hypot(self._noise, TORQUE_ERROR * load)[known]
        own = _loads(self._robot, poses, node, _in_world(poses[node], path))
        A = np.zeros((len(path), len(change), 3 + 3 * len(others)))
        A[:, :, :3] = own
        for i, other in enumerate(others):
            place = _in_world(poses[other.node], other.place[None])
            loads = _loads(self._robot, poses, other.node, place)[0]
            A[:, :, 3 + 3 * i : 6 + 3 * i] = loads * other.spread
        A = A[:, known] / sigma[:, None]
        y = change[known] / sigma
        N = A.transpose(0, 2, 1) @ A
        free = np.arange(3, N.shape[1])
        N[:, free, free] += 1.0  # the other forces change by so much
        N[:, :3, :3] += 1e-9 * np.eye(3)
        b = A.transpose(0, 2, 1) @ y
        solved = np.asarray(np.linalg.solve(N, b[:, :, None])[:, :, 0], float)
        cost: Array = -np.einsum("pi,pi->p", b, solved)
        return cost, solved[:, :3]


def _in_world(T: Array, points: Array) -> Array:
    return points @ T[:3, :3].T + T[:3, 3]


def _loads(robot: Robot, poses: Sequence[Array], node: int, points: Array) -> Array:
    """What forces at points (p, 3) in world of a node bring: (p, 6 + n, 3)."""
    x, y, z = points.T
    loads = np.zeros((len(points), 6 + len(robot.joint_names), 3))
    loads[:, :3] = np.eye(3)
    loads[:, 3, 1], loads[:, 3, 2] = -z, y
    loads[:, 4, 0], loads[:, 4, 2] = z, -x
    loads[:, 5, 0], loads[:, 5, 1] = -y, x
    while node >= 0:
        here, T = robot.nodes[node], poses[node]
        if here.coordinate >= 0:
            axis = T[:3, 2]
            way = axis if here.kind == "prismatic" else np.cross(axis, points - T[:3, 3])
            loads[:, 6 + here.coordinate] += here.multiplier * way
        node = here.parent
    return loads
