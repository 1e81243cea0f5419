# SPDX-License-Identifier: Apache-2.0
"""What errors of a model may do to each row as the arm moves, where nobody has calibrated.

Masses, inertias and centres of mass are taken to be off by a stated part. What that does to the
rows follows from inverse dynamics of arms that are off at random, in random poses and motions.
"""

import numpy as np

from touchline.arrays import Array
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.dynamics import inverse_dynamics
from touchline.tuning import DEFAULTS

ARMS, POSES = 6, 32  # that are drawn
WAY = DEFAULTS["detector.drift_way"]  # rad


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
    n, m = len(robot.joint_names), len(robot.segment_names)
    torques, wrenches = np.zeros((n, 3)), np.zeros((m, 6, 3))
    rng = np.random.default_rng(0)
    states = _states(robot, rng)
    right = inverse_dynamics(robot, *states)
    for g, segment in enumerate(robot.segment_names):
        links = {name for body in robot.bodies if body.segment == segment for name in body.links}
        joints = [j for j in range(n) if robot.joint_segments[j] == segment]
        for _ in range(ARMS):
            mechanism = perturbed(robot.mechanism, error, rng, links)
            wrong = inverse_dynamics(Robot(robot.description, mechanism), *states)
            torques[joints] += _squares(wrong.torque - right.torque)[joints] / ARMS
            if segment != "root":
                s = robot.sensor_names.index(segment)
                wrenches[g] += _squares(wrong.wrench[:, s] - right.wrench[:, s]) / ARMS
    return np.sqrt(torques), np.sqrt(wrenches)


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
