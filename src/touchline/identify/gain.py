# SPDX-License-Identifier: Apache-2.0
"""Gains of motor currents that are not as described.

What the model expects is taken to be a factor off, not the reading: a fit that may shrink the
reading shrinks it, for it then also shrinks what friction and noise leave. Biases, friction, a
payload and inertias are free beside the factors, so only a gain that these cannot make up is told.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Mask
from touchline.identify.choice import Chooser
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Column, Solution
from touchline.model.robot import Robot

LINKS = 0.03  # 1 sigma of inertias about the model's, as of `SIGMAS`: gains are known less well
SURE = 5.0  # standard errors
LEAST = 0.05  # of the gain: less than that friction and inertias can be
AGREE = 0.5  # of the difference: how far those of two halves of the data may be apart
FARTHEST = 3.0  # times the described gain, or a third of it: beyond that a load is missing
DIGITS = 4  # of a written gain


@dataclass(frozen=True)
class Gain:
    """A joint whose gain is off.

    Attributes:
        name: of the joint.
        factor, error: of the gain to the described one, with one standard error.
    """

    name: str
    factor: float
    error: float

    @property
    def plausible(self) -> bool:
        """May a gain be that far off? A load that the description lacks may look like more."""
        return 1.0 / FARTHEST < self.factor < FARTHEST


def find_gains(evidence: Evidence) -> list[Gain]:
    """Gains of motor currents that the data are sure of, and that two halves of them agree on.

    Gains, a payload and the masses scale together. So loads are taken as described, unless a
    force-torque sensor weighs them.
    """
    joints = evidence.robot.description.joints
    columns = tuple(Column("gain", j) for j in motor_joints(evidence.robot) if evidence.used[j])
    if not columns:
        return []
    half = np.arange(len(evidence)) < 0.5 * len(evidence)
    parts = [np.ones(len(evidence), dtype=bool), half, ~half]
    whole, *halves = (_fitted(evidence, part, columns) for part in parts)
    found = []
    for c in columns:
        value, error = whole.value(c.kind, c.row), whole.error(c.kind, c.row)
        apart = abs(halves[0].value(c.kind, c.row) - halves[1].value(c.kind, c.row))
        sure = abs(value) > max(SURE * error, LEAST) and apart < AGREE * abs(value)
        if sure and value > -1.0:  # else the sign is wrong
            factor = 1.0 / (1.0 + value)
            found.append(Gain(joints[c.row].name, factor, error * factor**2))
    return found


def motor_joints(robot: Robot) -> list[int]:
    """Joints whose torque is that of the motor."""
    return [j for j, joint in enumerate(robot.description.joints) if joint.torque == "motor"]


def with_gains(robot: Robot, gains: Sequence[Gain]) -> Robot:
    """The robot whose torques have the gains that were found, as far as they are plausible."""
    factor = {gain.name: gain.factor for gain in gains if gain.plausible}
    joints = tuple(
        replace(j, gain=float(f"{j.gain * factor[j.name]:.{DIGITS}g}")) if j.name in factor else j
        for j in robot.description.joints
    )
    return Robot(replace(robot.description, joints=joints), robot.mechanism)


def multiplied(before: Sequence[Gain], later: Sequence[Gain]) -> list[Gain]:
    """What was found in two rounds; the relative errors are those of the later one."""
    found = {gain.name: gain for gain in before}
    for own in later:
        old = found.get(own.name)
        if old is not None and old.plausible:
            own = replace(own, factor=old.factor * own.factor, error=old.factor * own.error)
        found[own.name] = own
    return list(found.values())


def _fitted(evidence: Evidence, use: Mask, columns: tuple[Column, ...]) -> Solution:
    """Factors beside columns of the rows, inertias, and a payload where a sensor weighs it."""
    chooser = Chooser(evidence, use)
    problem = chooser.richest(LINKS)
    if evidence.used[evidence.joints :].any():
        loads = tuple(body for body in chooser.loaded().bodies if body.added)
        problem = replace(problem, bodies=loads + problem.bodies)
    return chooser.fit_beside(columns, problem)
