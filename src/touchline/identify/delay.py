# SPDX-License-Identifier: Apache-2.0
"""How late torques and sensors come, beside the positions.

A reading that comes D late is what was expected D earlier: reading = M - D dM/dt. One number is
shared by all torques, and one by the axes of each sensor. Biases, friction and inertias are free
beside it (Frisch and Waugh, Econometrica 1(4), 1933), so that a wrong model is no delay.
"""

from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from touchline.arrays import Array, Mask
from touchline.identify.choice import Chooser
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Equations, Problem, applied, column_of, gradient_of
from touchline.model.robot import Robot

SURE = 4.0  # standard errors
LEAST = 3e-4  # s; a shorter delay is left alone
LONGEST = 0.2  # s; a longer one is a matter of the log's clocks
GAP = 2.5  # times the usual step between instants; no curve goes across
AGREE = 0.5  # of the delay: how far those of two halves of the data may be apart


@dataclass(frozen=True)
class Delay:
    """How late some rows come.

    Attributes:
        name: "torques", or the sensor's.
        value, error: [s], with one standard error.
    """

    name: str
    value: float
    error: float


def find_delays(evidence: Evidence, use: Mask | None = None) -> list[Delay]:
    """Delays that the data are sure of, and that two halves of them agree on."""
    use = np.ones(len(evidence), dtype=bool) if use is None else use
    chooser = Chooser(evidence, use)
    problem = chooser.loaded()
    order = np.cumsum(use) <= 0.5 * use.sum()
    parts = [_Beside(chooser, problem, part) for part in (use, use & order, use & ~order)]
    # What is expected with all that was fitted: a payload's weight changes as the model's does.
    rates, found = _rates(evidence, evidence.reading + parts[0].left), []
    for name, rows in _groups(evidence):
        of_group = np.zeros_like(rates)
        of_group[:, rows] = -rates[:, rows]
        whole, *halves = (part.value(of_group) for part in parts)
        if whole is None or not LEAST < abs(whole[0]) < LONGEST or abs(whole[0]) < SURE * whole[1]:
            continue
        values = [half[0] for half in halves if half is not None]
        if len(values) == 2 and abs(values[0] - values[1]) < AGREE * abs(whole[0]):
            found.append(Delay(name, *whole))
    return found


def with_delays(robot: Robot, delays: list[Delay]) -> Robot:
    """The robot whose description has these delays added to what it says.

    Where the positions come later, it says none: a description has delays of torques and sensors.
    """
    late = {delay.name: delay.value for delay in delays}

    def added(own: float, name: str) -> float:
        return max(round(own + late.get(name, 0.0), 6), 0.0)

    joints = tuple(
        replace(j, delay=added(j.delay, "torques")) if j.measured else j
        for j in robot.description.joints
    )
    sensors = tuple(replace(s, delay=added(s.delay, s.name)) for s in robot.description.sensors)
    description = replace(robot.description, joints=joints, sensors=sensors)
    return Robot(description, robot.mechanism)


def _groups(evidence: Evidence) -> list[tuple[str, list[int]]]:
    n, used = evidence.joints, evidence.used
    groups = [("torques", [j for j in range(n) if used[j]])]
    for s, sensor in enumerate(evidence.robot.description.sensors):
        groups.append((sensor.name, [r for r in range(n + 6 * s, n + 6 * s + 6) if used[r]]))
    return [(name, rows) for name, rows in groups if rows]


class _Beside:
    """Columns beside all else that may be wrong, at some instants.

    Args:
        chooser: whose instants they are.
        problem: what else may be wrong.
        use: (N,) the instants.

    Attributes:
        left: (N, R) residuals once that is fitted.
    """

    def __init__(self, chooser: Chooser, problem: Problem, use: Mask) -> None:
        self.chooser, self.use, self._problem = chooser, use, problem
        evidence = chooser.evidence
        equations = Equations.of(evidence, problem, chooser.start, chooser.weight, use)
        found = equations.solve()
        self.left = chooser.start + applied(evidence, found)
        self._J = equations.jacobian(found.steps)
        normal = self._J.T @ equations.normal @ self._J
        self._solve = np.linalg.pinv(normal + np.diag(equations.whole_prior()))

    def value(self, column: Array) -> tuple[float, float] | None:
        """The factor of a column (N, R) and its standard error; None where it is 0."""
        weight, use = self.chooser.weight, self.use
        gradient = gradient_of(self.chooser.evidence, self._problem, column, weight, use)
        own = self._without(column, gradient)
        size = float((weight * own * column)[use].sum())
        if size <= 0.0:
            return None
        value = -float((weight * own * self.left)[use].sum()) / size
        scores = (weight * own * (self.left + value * own)).sum(axis=1)[use]
        blocks = np.unique(self.chooser.blocks[use], return_inverse=True)[1]
        error = float(np.sqrt((np.bincount(blocks, scores) ** 2).sum())) / size
        return value, error

    def _without(self, column: Array, gradient: Array) -> Array:
        """A column (N, R) without what the model could make of it."""
        values = self._J @ (-self._solve @ (self._J.T @ gradient))
        return column + _applied(self.chooser, self._problem, values)


def _rates(evidence: Evidence, expected: Array) -> Array:
    """How fast expected readings (N, R) change.

    By cubic splines: central differences over 40 ms take 3 % off what changes at 3 Hz.
    """
    rates = np.zeros_like(expected)
    steps = np.diff(evidence.time)
    apart = (np.diff(evidence.recording) != 0) | (steps > GAP * np.median(steps))
    for own in np.split(np.arange(len(evidence)), np.flatnonzero(apart) + 1):
        if len(own) > 3:
            rates[own] = CubicSpline(evidence.time[own], expected[own])(evidence.time[own], 1)
    return rates


def _applied(chooser: Chooser, problem: Problem, values: Array) -> Array:
    """What columns and changes of bodies add to the residual (N, R)."""
    evidence = chooser.evidence
    added = np.zeros(evidence.reading.shape)
    for column, value in zip(problem.columns, values, strict=False):
        added[:, column.row] += value * column_of(evidence, column, column.row)
    bodies = values[len(problem.columns) :].reshape(-1, 10)
    for body, change in zip(problem.bodies, bodies, strict=True):
        added += evidence.model[:, :, body.node] @ change
    return np.where(evidence.used, added, 0.0)
