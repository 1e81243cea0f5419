# SPDX-License-Identifier: Apache-2.0
"""How far readings are from what the model expects, by the torque of each joint and by sensor."""

import numpy as np
from scipy.optimize import nnls

from touchline.arrays import Array
from touchline.check.joints import TELLING
from touchline.check.windows import DRY_SPEED, Windows
from touchline.model.description import SensorDescription
from touchline.model.robot import Robot

BETTER = 0.8  # a change that leaves more than this part of what is off explains nothing
CLEARLY = 0.2  # nor does one that mends less; a wrong sign of one row is 1


def misfit(robot: Robot, windows: Windows, measured: list[int]) -> list[float]:
    """What is off of every joint's torque and every sensor, 0 to 1: of its size.

    A row without a reading is left out.
    """
    off = middle(departures(robot, windows, measured))
    return off[np.isfinite(off)].tolist()


def departures(
    robot: Robot,
    windows: Windows,
    measured: list[int],
    least: float = 0.0,
    currents: bool = False,
) -> Array:
    """How far readings (W, rows) are from what is expected, of the size of both; NaN: not known.

    The torques of the measured joints come first, as they are, of a size of `least` [Nm] or more.
    Then come the forces of sensors with six axes of their own, by how they change, for a sensor may
    have any bias. `currents`: may all torques be motors' currents, whatever is described?
    """
    r, e = windows.torque[:, measured].copy(), windows.expected_torque[:, measured]
    for i, j in enumerate(measured):
        if currents or robot.description.joints[j].torque == "motor":
            r[:, i] -= _driving(windows, j)
    rows = [_relative(r[..., None], e[..., None], least)]
    own = [k for k, sensor in enumerate(robot.description.sensors) if _has_own_axes(sensor)]
    if own:
        outboard = [robot.description.sensors[k].polarity == "outboard" for k in own]
        r, e = windows.wrench[:, own, :3], windows.expected_wrench[:, own, :3]
        e = np.where(outboard, 1.0, -1.0)[:, None] * e
        r = np.where(np.isfinite(e).all(axis=2, keepdims=True), r, np.nan)
        r = np.where(np.isfinite(r).all(axis=2, keepdims=True), r, np.nan)
        e = np.where(np.isfinite(r), e, np.nan)
        rows.append(_relative(r - middle(r), e - middle(e), TELLING))
    return np.concatenate(rows, axis=1)


def _has_own_axes(sensor: SensorDescription) -> bool:
    """Does it say all of a wrench, in its own frame, as it is?"""
    return sensor.frame == "sensor" and len(sensor.axes) == 6 and sensor.compensated == "none"


def middle(values: Array) -> Array:
    """Median over the first axis of what is known; NaN where nothing is."""
    if np.isfinite(values).all() and len(values):
        return np.median(values, axis=0)
    out = np.full(values.shape[1:], np.nan)
    some = np.isfinite(values).any(axis=0)
    out[some] = np.nanmedian(values[:, some], axis=0)
    return out


def total_misfit(robot: Robot, windows: Windows, measured: list[int]) -> float:
    """The sum over all rows."""
    return float(sum(misfit(robot, windows, measured)))


def mends(left: float, now: float) -> bool:
    """Does a change leave so much less that it explains something?"""
    return left <= min(BETTER * now, now - CLEARLY)


def _driving(windows: Windows, j: int) -> Array:
    """What (W,) unknown friction and the rotor may have in a motor's torque: never negative.

    A torque or a position of the wrong sign would need friction that drives the joint.
    """
    qd = windows.qd[:, j]
    columns = np.column_stack([np.tanh(qd / DRY_SPEED), qd, windows.acceleration[:, j]])
    beside = windows.torque[:, j] - windows.expected_torque[:, j]
    known = np.isfinite(beside) & np.isfinite(columns).all(axis=1)
    if not known.any():
        return np.zeros(len(qd))
    return columns @ nnls(columns[known], beside[known])[0]


def _relative(reading: Array, expected: Array, least: float) -> Array:
    """Distances (W, rows) of vectors (W, rows, c), of the size of both."""
    off = np.linalg.norm(reading - expected, axis=-1)
    unknown = np.isnan(off)
    sizes = np.stack([np.linalg.norm(x, axis=-1) for x in (reading, expected)], axis=1)
    size = middle(np.where(unknown[:, None], np.nan, sizes)).sum(axis=0)
    return off / np.maximum(size, max(least, 1e-9))
