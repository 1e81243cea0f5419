# SPDX-License-Identifier: Apache-2.0
"""Sudden pushes on an arm that moves as prescribed: how soon does which statistic rise?"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.trials.free_motion import (
    MotionMaker,
    Trajectory,
    generator,
    random_trajectory,
)
from touchline.trials.touches import Touch, TouchSampler

BEFORE, AFTER = 1.5, 0.05  # s, of motion before and after the onset


@dataclass(frozen=True)
class Push:
    """A force that begins suddenly and stays, on a point that moves with its link.

    Attributes:
        trajectory: of the arm.
        onset: [s].
        touch: where and, for 1 N, in which direction.
    """

    trajectory: Trajectory
    onset: float
    touch: Touch

    def path(self) -> "_Shifted":
        """The motion from `BEFORE` before the onset on."""
        return _Shifted(self.trajectory, self.onset - BEFORE)


def random_pushes(robot: Robot, count: int, seed: int) -> Iterator[Push]:
    """Pushes at reachable points of the structure, uniform over its surface, in random motion."""
    rng = generator(seed, 7)
    sampler = TouchSampler(Skin(robot), np.random.default_rng(seed), ("base",), floor=-10.0)
    for _ in range(count):
        trajectory = random_trajectory(robot, rng)
        onset = float(rng.uniform(5.0, 60.0))
        q = trajectory(np.array([onset]))[0][0]
        yield Push(trajectory, onset, sampler.sample(1.0, q))


class PushMaker:
    """What the sensors report around a push.

    Args:
        maker: makes the motion; its length is that of a trial.
    """

    def __init__(self, maker: MotionMaker) -> None:
        self._maker = maker
        self.first = round(BEFORE * maker.rate)  # the first sample with the force

    def samples(self, push: Push, force: float, rng: np.random.Generator) -> Samples:
        """A trial: the force [N] begins half an interval before sample `first`."""
        maker, n = self._maker, len(self._maker.robot.joint_names)
        q, qd, loads = maker.loads(push.path())
        after = q[self.first :]
        link = push.touch.patch.link
        contact = contact_loads(maker.robot, after, link, force * self._wrench(push, after))
        loads = loads.copy()
        loads[self.first :, :n] -= contact.torque
        loads[self.first :, n:] -= contact.wrench.reshape(len(after), -1)
        return maker.sensed(q, qd, loads, rng)

    def _wrench(self, push: Push, q: Array) -> Array:
        """Of a unit force, (N, 6), world axes, about the world origin."""
        robot, touch = self._maker.robot, push.touch
        node = touch.patch.node
        T = robot.poses(q[0])[node]
        local = T[:3, :3].T @ (touch.position - T[:3, 3])
        poses = np.array([robot.poses(x)[node] for x in q])
        point = poses[:, :3, :3] @ local + poses[:, :3, 3]
        force = np.tile(touch.force, (len(q), 1))
        return np.asarray(np.hstack([force, np.cross(point, force)]), dtype=np.float64)


@dataclass(frozen=True)
class _Shifted:
    """A trajectory that begins later."""

    trajectory: Trajectory
    start: float

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        return self.trajectory(time + self.start)
