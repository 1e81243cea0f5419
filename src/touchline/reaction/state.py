# SPDX-License-Identifier: Apache-2.0
"""The robot at one instant as a reaction sees it: its motion, its limits and its own dynamics."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot

RATE_STEP = 1e-5  # s over which the momentum's change along the motion is taken


@dataclass(frozen=True)
class Since:
    """Where the robot was when a reaction began.

    Attributes:
        time: [s].
        q: (n,) [rad or m].
        rest: (n,) that a robot which stops then holds; None until then.
    """

    time: float
    q: Array
    rest: Array | None = None


@dataclass(frozen=True)
class State:
    """One instant; inertia and torques are those of the robot's description, not measured.

    Attributes:
        robot: the robot.
        time: [s].
        q: (n,) [rad or m].
        qd: (n,) [rad/s or m/s].
        torque: (n,) that the robot's own controller asks for now, link side [Nm or N].
        tau_ext: (n,) external joint torques, NaN where not known [Nm or N].
        since: when the reaction began; None: now.
    """

    robot: Robot
    time: float
    q: Array
    qd: Array
    torque: Array
    tau_ext: Array | None = None
    since: Since | None = field(default=None)

    @property
    def age(self) -> float:
        """Time since the reaction began [s]."""
        return 0.0 if self.since is None else self.time - self.since.time

    @cached_property
    def inertia(self) -> Array:
        """Mass matrix (n, n): the momenta of unit velocities (eq. 11)."""
        units = np.eye(len(self.q))
        M = np.array([self.robot.terms(self.q, unit)[0][: len(self.q)] for unit in units])
        return (M + M.T) / 2

    @cached_property
    def gravity_torque(self) -> Array:
        """Torques (n,) that hold the robot's weight [Nm or N]."""
        return self.robot.terms(self.q, np.zeros_like(self.qd))[1][: len(self.q)]

    @cached_property
    def bias_torque(self) -> Array:
        """Torques (n,) for constant velocity: weight, Coriolis and centrifugal [Nm or N].

        From dp/dt = tau - n (eq. 11) with p = M qd and constant qd: tau = (dM/dt) qd + n.
        """
        ahead, behind = (
            self.robot.terms(self.q + step * self.qd, self.qd)[0]
            for step in (RATE_STEP, -RATE_STEP)
        )
        momentum_rate = (ahead - behind) / (2 * RATE_STEP)
        return (momentum_rate + self.robot.terms(self.q, self.qd)[1])[: len(self.q)]

    @cached_property
    def effort(self) -> Array:
        """Limits (n,) of the joint torques, inf where there are none [Nm or N]."""
        return _limits(self.robot)[2]

    @cached_property
    def range(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,) of the joint positions [rad or m]."""
        return _limits(self.robot)[:2]

    @cached_property
    def speed_limit(self) -> Array:
        """Limits (n,) of the joint velocities [rad/s or m/s]."""
        return _limits(self.robot)[3]

    def lever(self, link: str, point: Array, direction: Array) -> Array:
        """How fast each joint (n,) moves a point of a link along a direction.

        Times a force in that direction it is the joint torques of the force (J^T u, eq. 2).

        Args:
            link: that carries the point.
            point: (3,) in world [m].
            direction: (3,) unit vector in world.
        """
        poses, nodes = self.robot.poses(self.q), self.robot.nodes
        row, node = np.zeros(len(self.q)), self.robot.places[link].node
        while node >= 0:
            here = nodes[node]
            if here.coordinate >= 0:
                axis, origin = poses[node][:3, 2], poses[node][:3, 3]
                moved = axis if here.kind == "prismatic" else np.cross(axis, point - origin)
                row[here.coordinate] += here.multiplier * (direction @ moved)
            node = here.parent
        return row

    def advance(self, lever: Array) -> float:
        """How far the point of `lever` (n,) has come since the reaction began, to first order."""
        return 0.0 if self.since is None else float(lever @ (self.q - self.since.q))


def _limits(robot: Robot) -> tuple[Array, Array, Array, Array]:
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    columns = [(joint.lower, joint.upper, joint.effort, joint.velocity) for joint in joints]
    lower, upper, effort, velocity = np.array(columns, float).reshape(-1, 4).T
    return lower, upper, effort, velocity
