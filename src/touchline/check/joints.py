# SPDX-License-Identifier: Apache-2.0
"""Joint signals beside the model: signs, units and order of velocities and torques."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.check.findings import Findings
from touchline.check.fit import (
    ANGLE_FACTORS,
    MOMENT_FACTORS,
    Line,
    named_factor,
    robust_line,
    scatter_of,
)
from touchline.check.windows import Windows
from touchline.model.robot import Robot

Array = NDArray[np.float64]

MOVED = 0.02  # rad/s or m/s; slower says nothing of a velocity's sign
OFF = 0.1  # a velocity's factor may be off by this much
TELLING = 1.0  # Nm; a smaller expected torque says nothing of a torque's sign
GAIN_OFF = 0.2  # friction and a payload change a torque's factor by less
TAKEN_OUT = 0.15  # below this fraction of the expected torque, gravity is not in the signal
CLEARER = 0.3  # another joint explains a torque column so much better


@dataclass(frozen=True)
class TorqueFit:
    """reading = factor * expected + offset, with 1 sigma errors; `varied`: offset was fitted."""

    factor: float
    error: float
    offset: float
    offset_error: float
    scatter: float
    varied: bool

    @property
    def certain(self) -> bool:
        """Is the factor known well enough to be judged?"""
        return not self.varied or self.error < 0.15 * max(abs(self.factor), 0.3)


def check_velocities(robot: Robot, windows: Windows, findings: Findings) -> None:
    """Compare logged velocities with the slopes of the positions."""
    for j, name in enumerate(robot.joint_names):
        slope, logged = windows.slope[:, j], windows.qd[:, j]
        moving = np.abs(slope) > MOVED
        if moving.sum() < 4 or not np.isfinite(logged[moving]).any():
            continue
        line = robust_line(slope[moving, None], logged[moving])
        if line is None:
            continue
        factor = float(line.coefficients[0])
        if abs(factor - 1) <= OFF:
            continue
        findings.find(_velocity_problem(name, factor, line.scatter, scatter_of(slope[moving])))


def _velocity_problem(name: str, factor: float, scatter: float, size: float) -> str:
    start = f"velocity of {name} is {factor:.3g} times the slope of its position"
    unit = named_factor(factor, ANGLE_FACTORS)
    if scatter > 0.5 * abs(factor) * size:
        return f"{start}, and does not follow it: another joint's column?"
    if abs(factor + 1) <= OFF:
        return f"{start}: opposite sign; use factor -1 in log: qd (or in log: q)"
    return f"{start}{': ' + unit if unit else '; check its unit and that of time'}"


def check_torques(
    robot: Robot, windows: Windows, dead: set[str], limits: dict[int, float], findings: Findings
) -> None:
    """Compare measured torques with those the model expects without contact.

    `limits` are the contact thresholds by joint [Nm].
    """
    measured = [
        j
        for j, joint in enumerate(robot.description.joints)
        if joint.measured
        and joint.compensated != "model"
        and joint.name not in dead
        and np.isfinite(windows.torque[:, j]).any()
    ]
    if not measured or not len(windows):
        return
    swapped = _swapped(windows, measured)
    for i, k in swapped:
        a, b = robot.joint_names[i], robot.joint_names[k]
        findings.find(f"torques of {a} and {b} fit each other's joint: the columns seem swapped")
    inside = {joint for pair in swapped for joint in pair}
    for j in measured:
        name = robot.joint_names[j]
        size = float(np.nanmax(np.abs(windows.expected_torque[:, j]), initial=0.0))
        if size < TELLING:
            line = f"  {name}: at most {size:.2g} Nm expected, too little to tell sign or unit"
            findings.note("joint torques", line)
            continue
        fit = fit_torque(windows, j)
        if fit is None:
            continue
        _note_fit(name, fit, findings)
        if j not in inside:
            _judge(name, fit, size, limits.get(j, np.inf), findings)


def fit_torque(windows: Windows, j: int) -> TorqueFit | None:
    """The line that leads from a joint's expected torque to its reading."""
    expected, reading, qd = windows.expected_torque[:, j], windows.torque[:, j], windows.qd[:, j]
    usable = np.isfinite(expected) & np.isfinite(reading)
    if not usable.any():
        return None
    expected, reading, qd = expected[usable], reading[usable], qd[usable]
    level = max(float(np.abs(np.median(expected))), TELLING)
    varied = float(np.std(expected)) > 0.1 * level
    columns = [expected, np.ones(len(expected))] if varied else [expected]
    if varied and min((qd > MOVED).mean(), (qd < -MOVED).mean()) > 0.1:
        columns += [np.tanh(qd / MOVED), qd]  # friction that the description does not know
    line: Line | None = robust_line(np.column_stack(columns), reading)
    if line is None:
        ratio = float(np.median(reading) / np.median(expected))
        return TorqueFit(ratio, np.inf, 0.0, np.inf, scatter_of(reading), False)
    offset, error = (line.coefficients[1], line.errors[1]) if varied else (0.0, np.inf)
    factor = float(line.coefficients[0]), float(line.errors[0])
    return TorqueFit(*factor, float(offset), float(error), line.scatter, varied)


def _note_fit(name: str, fit: TorqueFit, findings: Findings) -> None:
    if not fit.certain:
        findings.note("joint torques", f"  {name}: the load varies too little, or touches hide it")
        return
    offset = f", offset {fit.offset:+.2f} Nm" if fit.varied else " (one load only: no offset told)"
    line = f"  {name}: reads {fit.factor:.3f} of what the model expects{offset}"
    findings.note("joint torques", f"{line}, scatter {fit.scatter:.2f} Nm")


def _judge(name: str, fit: TorqueFit, size: float, limit: float, findings: Findings) -> None:
    start = f"torque of {name} is {fit.factor:.3g} times what the model expects"
    unit = named_factor(fit.factor, {k: v for k, v in MOMENT_FACTORS.items() if abs(k - 1) > 0.5})
    if not fit.certain:
        return
    if abs(fit.factor) < TAKEN_OUT and unit is None:
        findings.find(f"{start}: gravity seems taken out already; compensated: gravity (or model)")
    elif unit is not None:
        sign = ", and of opposite sign: sign: -1" if fit.factor < 0 else ""
        findings.find(f"{start}: in {unit} (or gain){sign}")
    elif fit.factor < 0:
        findings.find(f"{start}: opposite sign; set the other sign ({name}: sign)")
    elif abs(fit.factor - 1) > GAIN_OFF and abs(fit.factor - 1) * size > max(limit, TELLING):
        findings.find(f"{start}: check gain, unit, and the masses outboard of it")
    if abs(fit.offset) > limit and fit.offset_error < 0.3 * abs(fit.offset):
        findings.find(
            f"torque of {name} has an offset of {fit.offset:+.2f} Nm that the description does "
            f"not know, more than its contact threshold {limit:.2f}: set bias"
        )


def _swapped(windows: Windows, measured: list[int]) -> list[tuple[int, int]]:
    """Pairs of joints whose readings each fit the other's expected torque far better."""
    if len(windows) < 4:
        return []
    cost = np.array([[_misfit(windows, i, k) for k in measured] for i in measured])
    best = cost.argmin(axis=1)
    pairs = []
    for a, b in enumerate(best):
        better = cost[a, b] < CLEARER * cost[a, a] and cost[b, a] < CLEARER * cost[b, b]
        if a < b and best[b] == a and better:
            pairs.append((measured[a], measured[b]))
    return pairs


def _misfit(windows: Windows, i: int, k: int) -> float:
    """How badly joint i's reading fits joint k's expected torque, up to sign and small offset."""
    reading, expected = windows.torque[:, i], windows.expected_torque[:, k]
    usable = np.isfinite(reading) & np.isfinite(expected)
    if not usable.any():
        return np.inf
    reading, expected = reading[usable], expected[usable]
    return 0.05 + min(float(np.median(np.abs(reading - sign * expected))) for sign in (1, -1))
