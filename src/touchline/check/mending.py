# SPDX-License-Identifier: Apache-2.0
"""What is done to a recording's signals so that what else is wrong with it can be judged."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array, Index
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads
from touchline.observer.samples import Samples


@dataclass(frozen=True)
class Mending:
    """Changes to the signals of a log, for n joints and k force-torque sensors.

    Attributes:
        time: factor of the stamps.
        joints: (n,) column of the log that holds each joint's position and velocity.
        position: (n,) factors.
        velocity: (n,) factors; NaN: taken from the positions instead.
        order: (n,) column of the log that holds each joint's torque.
        torque: (n,) factors.
        weights: the robot whose weights are added to the torques, or None.
        guessed: do the columns of some joints only seem to be these?
        wrench: (k, 6, 6) what leads from a sensor's columns to those that it should have.
    """

    time: float
    joints: Index
    position: Array
    velocity: Array
    order: Index
    torque: Array
    wrench: Array
    weights: Robot | None = None
    guessed: bool = False

    @staticmethod
    def none(robot: Robot) -> "Mending":
        """All signals as they are."""
        n, k = len(robot.joint_names), len(robot.sensor_names)
        ones, own = np.ones(n), np.arange(n)
        return Mending(1.0, own, ones, ones, own, ones, np.tile(np.eye(6), (k, 1, 1)))

    def apply(self, parts: Iterable[Samples]) -> Iterator[Samples]:
        """The mended samples, part by part."""
        turned = [k for k, M in enumerate(self.wrench) if not np.array_equal(M, np.eye(6))]
        for part in parts:
            time, q = part.time * self.time, part.q[:, self.joints] * self.position
            qd = part.qd[:, self.joints] * self.velocity
            for j in np.flatnonzero(np.isnan(self.velocity)):
                qd[:, j] = _slope(time, q[:, j])
            wrench = part.wrench.copy() if turned else part.wrench
            for k in turned:
                wrench[:, k] = _times(part.wrench[:, k], self.wrench[k])
            tau = part.tau[:, self.order] * self.torque
            if self.weights is not None:
                joints = self.weights.description.joints
                scale = np.array([joint.sign * joint.gain for joint in joints])
                tau = tau + gravity_loads(self.weights, q).torque / scale
            yield replace(part, time=time, q=q, qd=qd, tau=tau, wrench=wrench)

    @property
    def reordered(self) -> bool:
        """Does a joint's signal stand in the column of another one?"""
        own = np.arange(len(self.joints))
        return not (np.array_equal(self.joints, own) and np.array_equal(self.order, own))

    def ordered(self, joints: Index, torques: Index, guessed: bool = False) -> "Mending":
        """With positions and velocities, and torques, from the columns of other joints.

        Args:
            joints: (n,) number of the joint in whose columns each position and velocity stands.
            torques: (n,) the same, of the torques.
            guessed: is some of it a guess?
        """
        return replace(
            self,
            joints=self.joints[joints],
            position=self.position[joints],
            velocity=self.velocity[joints],
            order=self.order[torques],
            torque=self.torque[torques],
            guessed=self.guessed or guessed,
        )

    def scaled(self, what: str, joints: list[int] | slice, factor: float) -> "Mending":
        """With the factor of some joints' `position`, `velocity` or `torque` changed."""
        values = getattr(self, what).copy()
        values[joints] *= factor
        return replace(self, **{what: values})


def _slope(time: Array, q: Array) -> Array:
    """Central differences (N,); 0 where stamps do not go forward."""
    if len(q) < 2:
        return np.zeros_like(q)
    before = np.concatenate([[0], np.arange(len(q) - 1)])
    after = np.concatenate([np.arange(1, len(q)), [len(q) - 1]])
    steps = time[after] - time[before]
    return np.divide(q[after] - q[before], steps, out=np.zeros_like(q), where=steps > 0)


def _times(values: Array, M: Array) -> Array:
    """M times each row of values (N, 6); an axis that is not measured counts only where used."""
    out = np.zeros_like(values)
    for row in range(6):
        for column in np.flatnonzero(M[row]):
            out[:, row] += M[row, column] * values[:, column]
    return out
