# SPDX-License-Identifier: Apache-2.0
"""How late torques and sensors come, beside the positions.

A reading that comes D late is what was expected D earlier: reading = M - D dM/dt. One number is
shared by all torques, and one by the axes of each sensor. Biases, friction and inertias are free
beside it (Frisch and Waugh, Econometrica 1(4), 1933), so that a wrong model is no delay.
"""

from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array, Mask
from touchline.identify.choice import Chooser
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Equations, column_of
from touchline.identify.regressor import body_vector
from touchline.model.robot import Robot

SURE = 4.0  # standard errors
LEAST = 3e-4  # s; a shorter delay is left alone
LONGEST = 0.2  # s; a longer one is a matter of the log's clocks
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
    order = np.cumsum(use) <= 0.5 * use.sum()
    found = []
    for name, rows in _groups(evidence):
        whole = _delay(chooser, rows, use)
        if whole is None or not LEAST < abs(whole[0]) < LONGEST or abs(whole[0]) < SURE * whole[1]:
            continue
        halves = [_delay(chooser, rows, use & part) for part in (order, ~order)]
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


def _delay(chooser: Chooser, rows: list[int], use: Mask) -> tuple[float, float] | None:
    """Delay and standard error [s]; None where nothing moves."""
    evidence = chooser.evidence
    rate = np.zeros_like(evidence.reading)
    rate[:, rows] = -_rates(evidence)[:, rows]
    problem, weight = chooser.richest(), chooser.weight
    of_rate = Equations.of(evidence, problem, rate, weight, use)
    of_start = Equations.of(evidence, problem, chooser.start, weight, use)
    J = of_start.jacobian_at_start()
    A = J.T @ of_start.normal @ J + np.diag(of_start.whole_prior())
    solve = np.linalg.pinv(A)
    own = rate + _applied(chooser, J @ (-solve @ (J.T @ of_rate.gradient)))
    left = chooser.start + _applied(chooser, J @ (-solve @ (J.T @ of_start.gradient)))
    size = float((weight * own * rate)[use].sum())
    if size <= 0.0:
        return None
    value = -float((weight * own * left)[use].sum()) / size
    scores = (weight * own * (left + value * own)).sum(axis=1)[use]
    blocks = np.unique(chooser.blocks[use], return_inverse=True)[1]
    error = float(np.sqrt((np.bincount(blocks, scores) ** 2).sum())) / size
    return value, error


def _rates(evidence: Evidence) -> Array:
    """How fast the rows' expected readings change (N, R), by central differences."""
    bodies = np.array([body_vector(node.inertia) for node in evidence.robot.nodes])
    expected = np.einsum("nrbk,bk->nr", evidence.model, bodies)
    rates = np.zeros_like(expected)
    for number in np.unique(evidence.recording):
        own = np.flatnonzero(evidence.recording == number)
        if len(own) > 2:
            rates[own] = np.gradient(expected[own], evidence.time[own], axis=0)
    return rates


def _applied(chooser: Chooser, values: Array) -> Array:
    """What columns and changes of bodies add to the residual (N, R)."""
    evidence, problem = chooser.evidence, chooser.richest()
    added = np.zeros(evidence.reading.shape)
    for column, value in zip(problem.columns, values, strict=False):
        added[:, column.row] += value * column_of(evidence, column)
    bodies = values[len(problem.columns) :].reshape(-1, 10)
    for body, change in zip(problem.bodies, bodies, strict=True):
        added += evidence.model[:, :, body.node] @ change
    return np.where(evidence.used, added, 0.0)
