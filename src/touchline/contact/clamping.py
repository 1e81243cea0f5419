# SPDX-License-Identifier: Apache-2.0
"""Clamped or free: do forces on two sides oppose each other?

Between segments that is seen: two forces of comparable size in opposite directions. Within one
segment the wrench is only their sum; but a joint between them feels one of them alone, and a joint
torque larger than the net force could cause at the arm's full reach shows forces that cancel.
"""

import numpy as np
from numpy.typing import NDArray

from touchline.contact.thresholds import Thresholds
from touchline.estimation.observer import Estimate
from touchline.model.robot import Robot

Array = NDArray[np.float64]

LEAST_TIME = 0.02  # s for which it must hold
LEAST_FORCE = 5.0  # N
RATIO, COSINE = 0.3, -0.5  # of the smaller to the larger force, of the angle between them
MARGIN = 1.2  # links are thicker than the chain of their joints is long
LINK_LENGTH = 0.2  # m beyond the last joint
THRESHOLDS = 3.0  # contact thresholds of a joint beyond what the net force explains


class Clamping:
    """Follows the samples of a pipeline; the same in whatever parts they come.

    Args:
        robot: the robot.
        thresholds: of the detector, for the joints' noise.
    """

    def __init__(self, robot: Robot, thresholds: Thresholds) -> None:
        self._m = len(robot.segment_names)
        reach = joint_reach(robot)
        root = robot.segment_names.index("root") if "root" in robot.segment_names else -1
        rows = [row for row in thresholds.rows if row.joint >= 0 and row.segment != root]
        self._joint = np.array([row.joint for row in rows], dtype=int)
        self._segment = np.array([row.segment for row in rows], dtype=int)
        self._reach = MARGIN * reach[self._joint]
        self._excess = np.array([THRESHOLDS * row.contact for row in rows])
        self._since: dict[int, float] = {}

    def reset(self) -> None:
        """Nothing touches any more."""
        self._since = {}

    def follow(self, time: Array, estimate: Estimate, levels: NDArray) -> NDArray[np.bool_]:
        """Whether each segment is clamped (N, m), after N samples with `levels` (N, m)."""
        clamped = np.zeros(levels.shape, dtype=bool)
        active = levels > 0
        touched = np.flatnonzero(active.any(axis=1))
        if not len(touched):
            self._since = {}
            return clamped
        opposed = np.zeros(levels.shape, dtype=bool)
        forces = np.nan_to_num(estimate.segment_wrench[touched, :, :3])
        torques = np.abs(np.nan_to_num(estimate.segment_torque[touched][:, self._joint]))
        found = self._between(forces, active[touched]) | self._within(forces, torques)
        opposed[touched] = found & active[touched]
        for g in range(self._m):
            clamped[:, g] = self._lasting(g, time, opposed[:, g])
        return clamped

    def _between(self, forces: Array, active: NDArray) -> NDArray[np.bool_]:
        """Segments (T, m) whose force another segment's opposes."""
        sizes = np.linalg.norm(forces, axis=2)
        strong = active & (sizes > LEAST_FORCE)
        product = sizes[:, :, None] * sizes[:, None, :]
        against = forces @ np.swapaxes(forces, 1, 2) < COSINE * product
        comparable = np.minimum(sizes[:, :, None], sizes[:, None, :]) > RATIO * np.maximum(
            sizes[:, :, None], sizes[:, None, :]
        )
        both = strong[:, :, None] & strong[:, None, :]
        return (against & comparable & both).any(axis=2)

    def _within(self, forces: Array, torques: Array) -> NDArray[np.bool_]:
        """Segments (T, m) with a joint torque that their net force cannot cause."""
        sizes = np.linalg.norm(forces, axis=2)
        beyond = torques > self._reach * sizes[:, self._segment] + self._excess
        found = np.zeros(sizes.shape, dtype=bool)
        for i, g in enumerate(self._segment.tolist()):
            found[:, g] |= beyond[:, i]
        return found

    def _lasting(self, g: int, time: Array, opposed: NDArray) -> NDArray[np.bool_]:
        """Where `opposed` (N,) has held without a break for LEAST_TIME."""
        if not opposed.any():
            self._since.pop(g, None)
            return opposed
        rises = opposed & ~np.concatenate([[g in self._since], opposed[:-1]])
        begins = np.where(rises, time, -np.inf)
        begins[0] = max(begins[0], self._since.get(g, -np.inf))
        since = np.maximum.accumulate(begins)
        if opposed[-1]:
            self._since[g] = float(since[-1])
        else:
            self._since.pop(g, None)
        return opposed & (time - since >= LEAST_TIME)


def joint_reach(robot: Robot) -> Array:
    """How far at most (n,) what each joint moves can be from it: the stretched chain [m]."""
    beyond = np.zeros(len(robot.nodes))
    reach = np.zeros(len(robot.joint_names))
    for i in reversed(range(len(robot.nodes))):
        node = robot.nodes[i]
        if node.coordinate >= 0:
            reach[node.coordinate] = max(reach[node.coordinate], beyond[i])
        if node.parent >= 0:
            step = float(np.linalg.norm(node.T_parent_node[:3, 3]))
            beyond[node.parent] = max(beyond[node.parent], beyond[i] + step)
    return reach + LINK_LENGTH
