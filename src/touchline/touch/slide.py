# SPDX-License-Identifier: Apache-2.0
"""Where on a slider a finger is while others touch the arm, too.

A finger on a known path has four unknowns, its force and the way along the path. So what changed
since before it landed tells them although a hand elsewhere wavers: the way is that for which one
force on the path, and changes of the other forces at their places, explain the change best.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.localizer.localizer import TORQUE_ERROR
from touchline.model.robot import Robot

Array = NDArray[np.float64]

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


class Slide:
    """Finds the way of a finger along a path.

    Args:
        robot: with its noise figures.
        node: that carries the path.
        path: (STEPS + 1, 3) [m] in the node's frame, at equal distances.
        sensor: of the segment, or None.
    """

    def __init__(self, robot: Robot, node: int, path: Array, sensor: str | None) -> None:
        self._robot, self._node, self._path = robot, node, path
        noise = robot.description.noise
        axes = noise.sensors.get(sensor, (1.0,) * 6) if sensor else (1.0,) * 6
        self._noise = np.array([*axes, *noise.tau])

    def at(
        self,
        poses: Sequence[Array],
        change: Array,
        others: Sequence[tuple[int, Array, Array, bool]],
    ) -> tuple[float, Array]:
        """The part of the way, 0 to 1, and the finger's force (3,) [N] in world.

        Args:
            poses: (4, 4) of all nodes in world.
            change: (6 + n,) of `Rows.values` since before the finger landed.
            others: node, place (3,) [m] and force (3,) [N] of each other contact, in world, and
                whether it is newer than the finger.
        """
        known = np.isfinite(change)
        load = np.abs(np.where(known, change, 0.0))
        load[:6] = 0.0
        sigma = np.hypot(self._noise, TORQUE_ERROR * load)[known]
        T = poses[self._node]
        points = self._path @ T[:3, :3].T + T[:3, 3]
        own = _loads(self._robot, poses, self._node, points)
        rest = [_loads(self._robot, poses, node, x[None])[0] for node, x, _, _ in others]
        spread = [
            (1.0 if new else WAVER) * max(float(np.linalg.norm(force)), 1.0)
            for _, _, force, new in others
        ]
        A = np.zeros((len(points), len(change), 3 + 3 * len(rest)))
        A[:, :, :3] = own
        for i, (loads, sd) in enumerate(zip(rest, spread, strict=True)):
            A[:, :, 3 + 3 * i : 6 + 3 * i] = loads * sd
        A = A[:, known] / sigma[:, None]
        y = change[known] / sigma
        N = A.transpose(0, 2, 1) @ A
        free = np.arange(3, N.shape[1])
        N[:, free, free] += 1.0  # the other forces waver by so much
        N[:, :3, :3] += 1e-9 * np.eye(3)
        b = A.transpose(0, 2, 1) @ y
        solved = np.asarray(np.linalg.solve(N, b[:, :, None])[:, :, 0], float)
        cost: Array = -np.einsum("pi,pi->p", b, solved)
        best = int(np.argmin(cost))
        part = float(best)
        if 0 < best < len(cost) - 1:
            low, middle, high = cost[best - 1 : best + 2].tolist()
            bend = low - 2.0 * middle + high
            part += 0.5 * (low - high) / bend if bend > 0.0 else 0.0
        return part / (len(cost) - 1), solved[best, :3]


def _loads(robot: Robot, poses: Sequence[Array], node: int, points: Array) -> Array:
    """What forces at points (p, 3) of a node bring: (p, 6 + n, 3)."""
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
