# SPDX-License-Identifier: Apache-2.0
"""How late torques and sensors come, beside the positions.

A reading that comes D late is what was expected D earlier: reading = M - D dM/dt. One number is
shared by all torques, and one by the axes of each sensor. Biases, friction, inertias and the frames
of sensors are free beside it (Frisch and Waugh, Econometrica 1(4), 1933), so that a wrong model is
no delay.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline

from touchline.arrays import Array, Mask
from touchline.identify.choice import FINE_SCATTER, LEAST_SCATTER, Chooser
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Equations, Problem, applied, column_of, gradient_of
from touchline.identify.frame import frame_columns
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


def find_delays(evidence: Evidence) -> list[Delay]:
    """Delays that the data are sure of, and that two halves of them agree on."""
    order = np.arange(len(evidence)) < 0.5 * len(evidence)
    found = []
    for delay, *halves in _delays(evidence, [order, ~order]):
        size = abs(delay.value)
        if not LEAST < size < LONGEST or size < SURE * delay.error or len(halves) < 2:
            continue
        if abs(halves[0].value - halves[1].value) < AGREE * size:
            found.append(delay)
    return found


def refined(delays: Sequence[Delay], evidence: Evidence) -> list[Delay]:
    """The delays with what is left of them in readings from which they have been taken out.

    A model that was fitted to late readings is a little late itself, so `find_delays` makes a delay
    some percent too short. What is left is measured twice: rows count as for a model that errs,
    then by what it leaves of them. The surer figure is taken.

    Args:
        delays: as found.
        evidence: of the robot `with_delays`.
    """
    left: dict[str, Delay] = {}
    for least in (LEAST_SCATTER, FINE_SCATTER):
        for (own,) in _delays(evidence, [], least):
            if own.name not in left or own.error < left[own.name].error:
                left[own.name] = own
    # A description has no delay of the positions, so that is still in the readings.
    again = {x.name: left[x.name] for x in delays if x.value > 0.0 and x.name in left}
    return [
        Delay(x.name, x.value + again[x.name].value, again[x.name].error) if x.name in again else x
        for x in delays
    ]


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


def _delays(
    evidence: Evidence, parts: Sequence[Mask], least: float = LEAST_SCATTER
) -> Iterator[list[Delay]]:
    """Of each group of rows from all instants, then from parts (N,) of them, as far as these tell.

    Groups of which all instants tell nothing are left out. `least` is as for `Chooser`.
    """
    whole = np.ones(len(evidence), dtype=bool)
    chooser = Chooser(evidence, whole, least)
    loaded = chooser.loaded()
    problem = replace(loaded, columns=(*loaded.columns, *frame_columns(evidence)))
    fits = [_Beside(chooser, problem, part) for part in (whole, *parts)]
    # What is expected with all that was fitted: a payload's weight changes as the model's does.
    rates = _rates(evidence, evidence.reading + fits[0].left)
    for name, rows in _groups(evidence):
        of_group = np.zeros_like(rates)
        of_group[:, rows] = -rates[:, rows]
        values = [fit.value(of_group) for fit in fits]
        if values[0] is not None:
            yield [Delay(name, *value) for value in values if value is not None]


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
        for r in column.rows:
            added[:, r] += value * column_of(evidence, column, r)
    bodies = values[len(problem.columns) :].reshape(-1, 10)
    for body, change in zip(problem.bodies, bodies, strict=True):
        added += evidence.model[:, :, body.node] @ change
    return np.where(evidence.used, added, 0.0)
