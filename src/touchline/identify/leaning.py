# SPDX-License-Identifier: Apache-2.0
"""What a base that leans does to readings: gravity points otherwise than described."""

from dataclasses import replace

import numpy as np

from touchline.arrays import Array
from touchline.identify.evidence import Evidence
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads

EDGE = 1e-4  # rad; residuals change linearly with so small a tilt


def level_axes(robot: Robot) -> Array:
    """(2, 3) world axes that are level, about which a base may lean."""
    return np.linalg.svd(robot.gravity[None])[2][1:]


def turned(evidence: Evidence, robot: Robot, change: Array) -> Array:
    """(N, R) what a small change (3,) of gravity, per unit, adds to the residual [N or Nm].

    Args:
        evidence: the instants.
        robot: with the weights that gravity acts on.
        change: of gravity in world axes [m/s2] per unit.
    """
    now, then = robot.gravity, robot.gravity + EDGE * change
    return (held_weights(evidence, robot, then) - held_weights(evidence, robot, now)) / EDGE


def held_weights(evidence: Evidence, robot: Robot, gravity: Array) -> Array:
    """(N, R) what holds the robot at rest, as far as the readings show it."""
    moved = Robot(robot.description, replace(robot.mechanism, gravity=gravity))
    found = gravity_loads(moved, evidence.q)
    loads = np.concatenate([found.torque, found.wrench.reshape(len(evidence), -1)], axis=1)
    shown = evidence.used & ~evidence.rows.silent & ~evidence.rows.weightless
    return np.where(shown, loads, 0.0)
