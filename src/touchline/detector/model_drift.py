# SPDX-License-Identifier: Apache-2.0
"""What errors of a model may do to each row as the arm moves, where nobody has calibrated.

Masses, inertias and centres of mass are taken to be off by a stated part. What that does to the
rows follows from inverse dynamics of arms that are off at random, in random poses and motions.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from touchline.arrays import Array
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.dynamics import inverse_dynamics
from touchline.tuning import DEFAULTS

ARMS, POSES = 6, 32  # that are drawn
WAY = DEFAULTS["detector.drift_way"]  # rad
# Digits after the point [N, Nm] that are kept. The draws are worth two figures; what processors
# round differently is gone, so that no place hangs on it.
DIGITS = 9


@dataclass(frozen=True)
class LinkErrors:
    """What errors of the links of each segment of a robot do to joints and sensors.

    Three mean squares each: of what changes on a way of `WAY`; per squared speed; per acceleration.

    Attributes:
        segments: (m) names.
        sensors: (k) names.
        torques: (m, n, 3) at each joint.
        wrenches: (m, k, 6, 3) at each sensor, in its frame.
    """

    segments: tuple[str, ...]
    sensors: tuple[str, ...]
    torques: Array
    wrenches: Array

    def drift(self, robot: Robot, parts: dict[str, list[str]]) -> tuple[Array, Array]:
        """As `guess_drift`, of this robot or of one that has lost some of its sensors.

        Args:
            robot: that one.
            parts: names of segments here that each of its segments consists of.
        """
        at = {name: [self.segments.index(part) for part in parts[name]] for name in parts}
        joints = robot.joint_segments
        torques = np.array([self.torques[at[name], j].sum(axis=0) for j, name in enumerate(joints)])
        wrenches = np.zeros((len(robot.segment_names), 6, 3))
        for g, name in enumerate(robot.segment_names):
            if name != "root":
                wrenches[g] = self.wrenches[at[name], self.sensors.index(name)].sum(axis=0)
        return np.sqrt(torques).round(DIGITS), np.sqrt(wrenches).round(DIGITS)


@lru_cache(maxsize=4)
def link_errors(robot: Robot, error: float) -> LinkErrors:
    """By inverse dynamics of arms that are off at random; `error` as of `guess_drift`.

    Takes some 50 ms for seven joints and three sensors, so that the last ones are kept.
    """
    n, k, m = len(robot.joint_names), len(robot.sensor_names), len(robot.segment_names)
    torques, wrenches = np.zeros((m, n, 3)), np.zeros((m, k, 6, 3))
    rng = np.random.default_rng(0)
    states = _states(robot, rng)
    right = inverse_dynamics(robot, *states)
    for g, segment in enumerate(robot.segment_names):
        links = {name for body in robot.bodies if body.segment == segment for name in body.links}
        for _ in range(ARMS):
            mechanism = perturbed(robot.mechanism, error, rng, links)
            wrong = inverse_dynamics(Robot(robot.description, mechanism), *states)
            torques[g] += _squares(wrong.torque - right.torque) / ARMS
            wrenches[g] += _squares(wrong.wrench - right.wrench) / ARMS
    return LinkErrors(robot.segment_names, robot.sensor_names, torques, wrenches)


def guess_drift(robot: Robot, error: float) -> tuple[Array, Array]:
    """Sigmas of the errors of joint torques and segment wrenches, as of a `RowCalibration`.

    A row is in error by what the links of its own segment are: those further out are taken out of
    it with what the sensors there say.

    Args:
        robot: the robot.
        error: 1 sigma of the relative error of masses and inertias (see `perturbed`).

    Returns:
        (n, 3) for the joints and (m, 6, 3) for the segments, in the frames of their sensors: what
        changes on a way of `WAY`; per squared speed; per acceleration.
    """
    own = {segment: [segment] for segment in robot.segment_names}
    return link_errors(robot, error).drift(robot, own)


def _states(robot: Robot, rng: np.random.Generator) -> tuple[Array, Array, Array]:
    """Poses, some way on, with unit speed, with unit acceleration (4 POSES, n)."""
    q = rng.uniform(*robot.ranges, (POSES, len(robot.joint_names)))
    way = rng.normal(size=(3, *q.shape))
    way, v, a = way / np.linalg.norm(way, axis=-1, keepdims=True)
    still = np.zeros_like(q)
    return (
        np.vstack([q, q + WAY * way, q, q]),
        np.vstack([still, still, v, still]),
        np.vstack([still, still, still, a]),
    )


def _squares(off: Array) -> Array:
    """Mean squares (..., 3) of the changes of errors (4 POSES, ...) of `_states`."""
    here, *others = off.reshape(4, POSES, *off.shape[1:])
    return np.stack([np.mean((other - here) ** 2, axis=0) for other in others], axis=-1)
