# SPDX-License-Identifier: Apache-2.0
"""A base that leans a little otherwise than described.

`check` tells a tilted base as well as links that are off let it. Here offsets, a payload and
inertias are free beside it. Only a gravity that the description names is refined: where none is,
what friction leaves of a level base would be taken for a lean.
"""

from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.identify.choice import Chooser
from touchline.identify.evidence import Evidence, level_axes
from touchline.identify.fit import Column
from touchline.model.robot import Robot

SURE = 5.0  # standard errors
LEAST = np.radians(0.05)  # rad; 0.1 N of 100 N that an arm weighs
DIGITS = 6  # of a written figure: 1e-6 m/s2


@dataclass(frozen=True)
class Lean:
    """How far the base leans.

    Attributes:
        turn: (2,) about each of `level_axes` of the described gravity [rad].
        error: (2,) one standard error [rad].
        gravity: (3,) in world axes [m/s2], as it then is.
    """

    turn: Array
    error: Array
    gravity: Array

    @property
    def angle(self) -> float:
        """Of the lean [rad]."""
        return float(np.linalg.norm(self.turn))


def find_lean(evidence: Evidence) -> Lean | None:
    """The lean of a base whose gravity is described; None where the data are not sure of any."""
    robot = evidence.robot
    if robot.description.gravity is None or not robot.gravity.any():
        return None
    chooser = Chooser(evidence, np.ones(len(evidence), dtype=bool))
    columns = lean_columns(evidence)
    found = chooser.choose_beside([(), columns])
    at = [found.problem.columns.index(c) for c in columns if c in found.problem.columns]
    if not at:
        return None
    turn, error = found.values[at], found.errors[at]
    if not (np.abs(turn) > np.maximum(SURE * error, LEAST)).any():
        return None
    return Lean(turn, error, leaned(robot, turn))


def lean_columns(evidence: Evidence) -> tuple[Column, ...]:
    """What a base that leans about each level axis would do."""
    return tuple(Column("lean", 0, axis=a, count=len(evidence.rows)) for a in range(2))


def leaned(robot: Robot, turn: Array) -> Array:
    """Gravity (3,) [m/s2] where the base leans by `turn` (2,) about the level axes [rad].

    Loads are linear in gravity, whose level part is the sine of the angle.
    """
    g = robot.gravity
    sine = min(1.0, float(np.linalg.norm(turn)))
    new = np.sqrt(1.0 - sine**2) * g
    for angle, axis in zip(turn, level_axes(robot), strict=True):
        new = new + angle * np.cross(axis, g)
    return new


def with_lean(robot: Robot, lean: Lean) -> Robot:
    """The robot whose gravity is as it was found."""
    gravity = np.round(lean.gravity, DIGITS) + 0.0
    x, y, z = gravity.tolist()
    description = replace(robot.description, gravity=(x, y, z))
    return Robot(description, replace(robot.mechanism, gravity=gravity))
