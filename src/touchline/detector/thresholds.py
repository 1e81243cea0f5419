# SPDX-License-Identifier: Apache-2.0
"""When a residual counts as a contact: thresholds from the noise figures or from `detection`."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.detector.limits import sum_limits, theoretical, threshold
from touchline.detector.model_drift import guess_drift
from touchline.detector.residual_noise import residual_noise
from touchline.model.description import (
    AXES,
    CalibrationDescription,
    DetectionDescription,
    LevelDescription,
    RowCalibration,
    Vector,
)
from touchline.model.robot import Robot
from touchline.tuning import DEFAULTS

SIGMAS = 6.0  # contact thresholds lie this many standard deviations of the residual out
FORCE_FLOOR, MOMENT_FLOOR, TORQUE_FLOOR = 0.5, 0.1, 0.1  # N, Nm, Nm: models are not better
# A calibration holds for sample periods within this ratio of its own.
PERIOD_RATIO = DEFAULTS["events.period_ratio"]
COLLISION_RATIO = 4.0
COLLISION_FORCE = 15.0  # N; below it nothing is called a collision unless the user says so
COLLISION_EFFORT = 0.2  # of a joint's effort limit


@dataclass(frozen=True)
class RowThreshold:
    """The test of one residual: a component (0-5) of a segment's wrench, or a joint's torque.

    `contact`, `collision` and `baseline_limit` are in N or Nm; wrenches are those in the frame of
    the segment's own sensor. A joint row has component -1, a wrench row has joint -1. `slow` and
    `quick` are sigmas of the model's errors, see `RowCalibration`; `drift` those that the localizer
    reckons with: the calibrated `slow` ones, otherwise see `expect_drift`. `contact` is kept `seen`
    sigmas of the noise, as told in each posture and as seen, above it; 0: it is given and stays.
    """

    segment: int
    component: int
    joint: int
    contact: float
    collision: float
    baseline_limit: float
    slow: Vector = (0.0, 0.0, 0.0)
    quick: Vector = (0.0, 0.0, 0.0)
    drift: Vector = (0.0, 0.0, 0.0)
    seen: float = 0.0


@dataclass(frozen=True)
class Thresholds:
    """All tests of a robot.

    Attributes:
        rows: what is tested, segment by segment.
        sum_limit: (m,) limit of the sum of squared rows; infinite where that is not tested.
        limits: method -> (m,) limit of its statistic on each segment.
        calibrated: do the limits have the false-alarm rate that the description names?
        note: why not, or None.
    """

    rows: tuple[RowThreshold, ...]
    sum_limit: Array
    limits: dict[str, Array]
    calibrated: bool = False
    note: str | None = None


def make_thresholds(robot: Robot, period: float = 1e-3) -> Thresholds:
    """The tests for a robot.

    Args:
        robot: whose `detection` overrides what would follow from its `noise`.
        period: time between samples [s]; the noise figures are per sample.

    Returns:
        Contact thresholds `SIGMAS` standard deviations of the filtered residual out (but not below
        the floors of this module). The sum limit has the false-alarm rate of one row.
    """
    detection = robot.description.detection
    calibration, note = _calibration(robot, period)
    joint_sigma, segment_sigma = residual_noise(robot, period)
    rows: list[RowThreshold] = []
    for g, segment in enumerate(robot.segment_names):
        if segment != "root":
            rows += _wrench_rows(g, segment, segment_sigma[segment], detection)
        rows += _joint_rows(robot, g, segment, joint_sigma, detection)
    counts = np.bincount([row.segment for row in rows], minlength=len(robot.segment_names))
    share = share_of_rate(robot, rows)
    if calibration is None:
        rows = [_at_least_calibrated(robot, row, share) for row in rows]
        limits = {m: theoretical(m, counts, share, period, detection) for m in detection.method}
        return Thresholds(tuple(rows), sum_limits(counts, SIGMAS), limits, note=note)
    limits, rows_limit = {}, np.ones(len(counts))
    for method in detection.method:
        tails = [calibration.tails.get(name, {}).get(method) for name in robot.segment_names]
        limits[method] = np.array([threshold(t, share) if t else np.inf for t in tails])
        if method == "rows":
            rows_limit, limits[method] = limits[method], np.ones(len(counts))
    beyond = share * calibration.hours < 1.0  # of what the recording can show: noise alone tells
    noise = theoretical("scaled", counts, share, period, detection) if beyond else rows_limit
    rows = [_calibrated_row(robot, row, calibration, rows_limit, noise) for row in rows]
    return Thresholds(tuple(rows), np.full(len(counts), np.inf), limits, calibrated=True)


def share_of_rate(robot: Robot, rows: Sequence[RowThreshold]) -> float:
    """Of the robot's false alarms, for each method in use on each segment with a row [1/h]."""
    detection = robot.description.detection
    segments = len({row.segment for row in rows})
    return detection.false_alarms / max(len(detection.method) * segments, 1)


def _calibration(robot: Robot, period: float) -> tuple[CalibrationDescription | None, str | None]:
    """The calibration that holds for this period; or None, and why."""
    given = robot.description.detection.calibration
    if given is None:
        return None, "not calibrated: thresholds follow from the noise figures (see `calibrate`)"
    if not 1 / PERIOD_RATIO < given.period / period < PERIOD_RATIO:
        what = f"calibrated at {1 / given.period:g} Hz, not at {1 / period:g} Hz"
        lower = "no row's is below its calibrated one"
        return None, f"{what}: thresholds follow from the noise figures, but {lower}"
    return given, None


def expect_drift(
    robot: Robot,
    thresholds: Thresholds,
    error: float,
    guess: Callable[[Robot, float], tuple[Array, Array]] = guess_drift,
) -> Thresholds:
    """The same tests; the localizer reckons with a guess for rows that no calibration knows.

    Args:
        robot: the robot.
        thresholds: its tests.
        error: 1 sigma of the relative error of the model's masses and inertias; 0: it is right.
        guess: what does.
    """
    if thresholds.calibrated or error == 0.0:
        return thresholds
    torques, wrenches = guess(robot, error)
    calibration = robot.description.detection.calibration
    known = {} if calibration is None else calibration.rows
    rows = []
    for row in thresholds.rows:
        if row_name(robot, row) in known:
            rows.append(row)
            continue
        found = torques[row.joint] if row.component < 0 else wrenches[row.segment, row.component]
        constant, speed, acceleration = found.tolist()
        rows.append(replace(row, drift=(constant, speed, acceleration)))
    return replace(thresholds, rows=tuple(rows))


def without_limits(thresholds: Thresholds) -> Thresholds:
    """The same tests, which never fire: for those who look at the statistics."""
    never = {method: np.full_like(limits, np.inf) for method, limits in thresholds.limits.items()}
    return replace(thresholds, limits=never)


def row_name(robot: Robot, row: RowThreshold) -> str:
    """Name of a row: that of its joint, or `SENSOR.fx` to `SENSOR.mz`."""
    if row.component < 0:
        return robot.joint_names[row.joint]
    return f"{robot.segment_names[row.segment]}.{AXES[row.component]}"


def _at_least_calibrated(robot: Robot, row: RowThreshold, share: float) -> RowThreshold:
    """The row with errors and no lower threshold than a calibration at another rate gives it.

    Noise depends on the rate of samples, errors of the model do not. Where these prevail noise
    alone would see contacts in them, and places would believe them.
    """
    detection = robot.description.detection
    calibration = detection.calibration
    known = None if calibration is None else calibration.rows.get(row_name(robot, row))
    if calibration is None or known is None:
        return row
    row = _with_errors(row, known)
    tail = calibration.tails.get(robot.segment_names[row.segment], {}).get("rows")
    kind, key = _kind(robot, row)
    if tail is None or _given(detection.contact, kind, key) is not None:
        return row
    contact = known.typical * threshold(tail, share)
    if contact <= row.contact:
        return row
    collision = row.collision
    if _given(detection.collision, kind, key) is None:
        collision = max(COLLISION_RATIO * contact, _least_collision(robot, row))
    limit = detection.baseline.limit * contact
    return replace(row, contact=contact, collision=collision, baseline_limit=limit)


def _with_errors(row: RowThreshold, known: RowCalibration) -> RowThreshold:
    return replace(row, slow=known.slow, quick=known.quick, drift=known.slow)


def _calibrated_row(
    robot: Robot,
    row: RowThreshold,
    calibration: CalibrationDescription,
    limits: Array,
    noise: Array,
) -> RowThreshold:
    """The row with what calibration says of it; thresholds that the user gave stay."""
    known = calibration.rows.get(row_name(robot, row))
    if known is None:
        return row
    detection = robot.description.detection
    kind, key = _kind(robot, row)
    contact, collision, seen = row.contact, row.collision, 0.0
    if _given(detection.contact, kind, key) is None and np.isfinite(limits[row.segment]):
        contact = known.typical * limits[row.segment]
        if "rows" in detection.method:
            # As the statistic that the tail was fitted to, and no rarer noise than it has met.
            seen = float(max(limits[row.segment], noise[row.segment]))
    if _given(detection.collision, kind, key) is None:
        collision = max(COLLISION_RATIO * contact, _least_collision(robot, row))
    limit = detection.baseline.limit * contact
    return replace(
        _with_errors(row, known),
        contact=contact,
        collision=collision,
        baseline_limit=limit,
        seen=seen,
    )


def _kind(robot: Robot, row: RowThreshold) -> tuple[str, str | int]:
    if row.component < 0:
        return "torque", row.joint
    return "force" if row.component < 3 else "moment", robot.segment_names[row.segment]


def _least_collision(robot: Robot, row: RowThreshold) -> float:
    """Below it nothing is called a collision unless the user says so."""
    if row.component >= 0:
        return COLLISION_FORCE if row.component < 3 else np.inf  # a moment alone is no collision
    effort = robot.mechanism.joints[robot.joint_names[row.joint]].effort
    return COLLISION_EFFORT * effort if np.isfinite(effort) else 0.0


def _wrench_rows(
    g: int, segment: str, sigma: Array, detection: DetectionDescription
) -> list[RowThreshold]:
    rows = []
    for component in range(6):
        is_force = component < 3
        kind = "force" if is_force else "moment"
        floor = FORCE_FLOOR if is_force else MOMENT_FLOOR
        safe = max(SIGMAS * sigma[component], floor)
        contact = _given(detection.contact, kind, segment)
        seen = SIGMAS if contact is None else 0.0
        contact = safe if contact is None else contact
        collision = _given(detection.collision, kind, segment)
        if collision is None:
            least = COLLISION_FORCE if is_force else np.inf  # a moment alone is no collision
            collision = max(COLLISION_RATIO * contact, least)
        limit = detection.baseline.limit * contact
        slow, quick = _unknown_errors(max(safe, contact))
        rows.append(
            RowThreshold(g, component, -1, contact, collision, limit, slow, quick, seen=seen)
        )
    return rows


def _joint_rows(
    robot: Robot, g: int, segment: str, sigma: Array, detection: DetectionDescription
) -> list[RowThreshold]:
    rows = []
    for j, joint in enumerate(robot.description.joints):
        if not joint.measured or robot.joint_segments[j] != segment:
            continue
        safe = max(SIGMAS * sigma[j], TORQUE_FLOOR)
        contact = _given(detection.contact, "torque", j)
        seen = SIGMAS if contact is None else 0.0
        contact = safe if contact is None else contact
        collision = _given(detection.collision, "torque", j)
        if collision is None:
            effort = robot.mechanism.joints[joint.name].effort
            least = COLLISION_EFFORT * effort if np.isfinite(effort) else 0.0
            collision = max(COLLISION_RATIO * contact, least)
        limit, (slow, quick) = (
            detection.baseline.limit * contact,
            _unknown_errors(max(safe, contact)),
        )
        rows.append(RowThreshold(g, -1, j, contact, collision, limit, slow, quick, seen=seen))
    return rows


def _unknown_errors(safe: float) -> tuple[Vector, Vector]:
    """Without calibration the model's errors are taken to be as large as a threshold allows."""
    return (safe / SIGMAS, 0.0, 0.0), (0.5 * safe / SIGMAS, 0.0, 0.0)


def _given(level: LevelDescription, kind: str, key: str | int) -> float | None:
    """What the description says: one number, one per joint, or one per sensor; None if nothing."""
    value = getattr(level, kind)
    if isinstance(value, dict):
        return value.get(key)
    if isinstance(value, tuple):
        return value[int(key)]
    return value
