# SPDX-License-Identifier: Apache-2.0
"""When a residual counts as a contact: thresholds from the noise figures or from `detection`."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.model.description import (
    AXES,
    CalibrationDescription,
    DetectionDescription,
    LevelDescription,
    TailDescription,
    Vector,
)
from touchline.model.robot import Robot
from touchline.model.transforms import move_wrench

Array = NDArray[np.float64]

SIGMAS = 6.0  # contact thresholds lie this many standard deviations of the residual out
CONFIGURATIONS = 64  # sampled for the largest effect of velocity noise
FORCE_FLOOR, MOMENT_FLOOR, TORQUE_FLOOR = 0.5, 0.1, 0.1  # N, Nm, Nm: models are not better
PERIOD_RATIO = 1.2  # a calibration holds for sample periods within this ratio of its own
CUSUM_SHIFT = 1.0  # as `kShift` in core/include/touchline/detection_row.hpp
COLLISION_RATIO = 4.0
COLLISION_FORCE = 15.0  # N; below it nothing is called a collision unless the user says so
COLLISION_EFFORT = 0.2  # of a joint's effort limit


@dataclass(frozen=True)
class RowThreshold:
    """The test of one residual: a component (0-5) of a segment's wrench, or a joint's torque.

    `contact`, `collision` and `baseline_limit` are in N or Nm; wrenches are those in the frame of
    the segment's own sensor. A joint row has component -1, a wrench row has joint -1. `slow` and
    `quick` are sigmas of the model's errors, see `RowCalibration`.
    """

    segment: int
    component: int
    joint: int
    contact: float
    collision: float
    baseline_limit: float
    slow: Vector = (0.0, 0.0, 0.0)
    quick: Vector = (0.0, 0.0, 0.0)


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
    share = detection.false_alarms / max(len(detection.method) * int((counts > 0).sum()), 1)
    if calibration is None:
        limits = {m: _theoretical(m, counts, share, period, detection) for m in detection.method}
        return Thresholds(tuple(rows), _sum_limits(counts), limits, note=note)
    limits, rows_limit = {}, np.ones(len(counts))
    for method in detection.method:
        tails = [calibration.tails.get(name, {}).get(method) for name in robot.segment_names]
        limits[method] = np.array([threshold(t, share) if t else np.inf for t in tails])
        if method == "rows":
            rows_limit, limits[method] = limits[method], np.ones(len(counts))
    rows = [_calibrated_row(robot, row, calibration, rows_limit) for row in rows]
    return Thresholds(tuple(rows), np.full(len(counts), np.inf), limits, calibrated=True)


def threshold(tail: TailDescription, rate: float) -> float:
    """What the tail's statistic exceeds `rate` times an hour; its beginning where that is more."""
    excess = np.log(max(tail.per_hour / rate, 1.0))
    if abs(tail.shape) > 1e-9:
        excess = np.expm1(tail.shape * excess) / tail.shape
    return float(tail.level + tail.scale * excess)


def siegmund(run_length: float, shift: float) -> float:
    """Threshold of a one-sided CUSUM on standard normal samples.

    Args:
        run_length: mean number of samples to a false alarm.
        shift: of the mean that it is made for; half of it is taken off each sample.

    The corrected diffusion approximation (Siegmund 1985): with b = h + 1.166 and k = shift / 2 the
    run length is (exp(2 k b) - 2 k b - 1) / (2 k^2).
    """
    least, most = 0.0, (np.log1p(0.5 * shift**2 * run_length) + 10.0) / shift + 10.0
    for _ in range(60):  # bisection: the run length grows with b
        b = 0.5 * (least + most)
        longer = np.expm1(shift * b) - shift * b > 0.5 * shift**2 * run_length
        least, most = (least, b) if longer else (b, most)
    return max(least - 1.166, 0.0)


def _calibration(robot: Robot, period: float) -> tuple[CalibrationDescription | None, str | None]:
    """The calibration that holds for this period; or None, and why."""
    given = robot.description.detection.calibration
    if given is None:
        return None, "not calibrated: thresholds follow from the noise figures (see `calibrate`)"
    if not 1 / PERIOD_RATIO < given.period / period < PERIOD_RATIO:
        what = f"calibrated at {1 / given.period:g} Hz, not at {1 / period:g} Hz"
        return None, f"{what}: thresholds follow from the noise figures"
    return given, None


def _theoretical(
    method: str, counts: NDArray[np.int64], rate: float, period: float, d: DetectionDescription
) -> Array:
    """Limits (m,) if noise were all: every sample is taken for a test of its own."""
    from scipy.special import chdtri, ndtri

    if method == "rows":
        return np.ones(len(counts))
    alarm = min(rate * period / 3600.0, 0.1)
    rows = np.maximum(counts, 1)
    if method == "scaled":
        return -ndtri(0.5 * alarm / rows)
    if method == "cusum":
        return np.array([siegmund(2 * n / alarm, CUSUM_SHIFT) for n in rows])
    tests = len(d.windows) if method == "glrt" else 1
    return np.sqrt(chdtri(rows, alarm / tests))


def _sum_limits(counts: NDArray[np.int64]) -> Array:
    from scipy.special import chdtri, erfc

    alarm = erfc(SIGMAS / np.sqrt(2))  # of one row: a normal variable beyond +-SIGMAS
    return chdtri(np.maximum(counts, 1), alarm) / SIGMAS**2


def without_limits(thresholds: Thresholds) -> Thresholds:
    """The same tests, which never fire: for those who look at the statistics."""
    never = {method: np.full_like(limits, np.inf) for method, limits in thresholds.limits.items()}
    return replace(thresholds, limits=never)


def row_name(robot: Robot, row: RowThreshold) -> str:
    """Name of a row: that of its joint, or `SENSOR.fx` to `SENSOR.mz`."""
    if row.component < 0:
        return robot.joint_names[row.joint]
    return f"{robot.segment_names[row.segment]}.{AXES[row.component]}"


def _calibrated_row(
    robot: Robot, row: RowThreshold, calibration: CalibrationDescription, limits: Array
) -> RowThreshold:
    """The row with what calibration says of it; thresholds that the user gave stay."""
    known = calibration.rows.get(row_name(robot, row))
    if known is None:
        return row
    detection = robot.description.detection
    kind, key = _kind(robot, row)
    contact, collision = row.contact, row.collision
    if _given(detection.contact, kind, key) is None and np.isfinite(limits[row.segment]):
        contact = known.typical * limits[row.segment]
    if _given(detection.collision, kind, key) is None:
        collision = max(COLLISION_RATIO * contact, _least_collision(robot, row))
    limit = detection.baseline.limit * contact
    return replace(
        row,
        contact=contact,
        collision=collision,
        baseline_limit=limit,
        slow=known.slow,
        quick=known.quick,
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


def residual_noise(robot: Robot, period: float) -> tuple[Array, dict[str, Array]]:
    """Standard deviations of the filtered residuals, the largest over sampled configurations.

    Torque and wrench noise per sample is low-passed, factor sqrt(K dt / 2); velocity noise enters
    through the momentum as K times the momentum it makes (theory: K M sigma_qd).

    Returns:
        (n,) [Nm] for the joints and per segment (6,) [N, Nm] in its sensor's frame.
    """
    noise = robot.description.noise
    n, k = len(robot.joint_names), len(robot.sensor_names)
    K = np.array(robot.description.bandwidth_joints)
    joint_var = np.square(noise.tau) * np.minimum(1.0, K * period / 2)
    momentum_var = np.zeros(n)
    segments = {name: np.zeros(6) for name in robot.segment_names if name != "root"}
    for q in _configurations(robot):
        momenta = [robot.terms(q, speed)[0] for speed in np.diag(noise.qd)]
        columns = np.stack(momenta, axis=-1).reshape(n + 6 * k, n)
        momentum_var = np.maximum(momentum_var, np.square(K[:, None] * columns[:n]).sum(axis=1))
        for name, so_far in segments.items():
            variance = _segment_variance(robot, name, q, columns[n:].reshape(k, 6, n), period)
            segments[name] = np.maximum(so_far, variance)
    return np.sqrt(joint_var + momentum_var), {s: np.sqrt(v) for s, v in segments.items()}


def _configurations(robot: Robot) -> Array:
    rng = np.random.default_rng(0)
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    lower = np.array([max(joint.lower, -np.pi) for joint in joints])
    upper = np.array([min(joint.upper, np.pi) for joint in joints])
    return rng.uniform(
        np.minimum(lower, upper), np.maximum(lower, upper), (CONFIGURATIONS, len(joints))
    )


def _segment_variance(robot: Robot, segment: str, q: Array, momenta: Array, period: float) -> Array:
    """Variance (6,) of a segment's wrench in its sensor's frame, at one configuration."""
    noise = robot.description.noise
    bandwidth = robot.description.bandwidth_sensors[segment]
    poses = robot.sensor_poses(q)
    own = robot.sensor_names.index(segment)
    momentum = momenta[own].copy()
    reading = np.square(noise.sensors[segment])
    for successor in robot.successors(segment):
        other = robot.sensor_names.index(successor)
        move = move_wrench(np.linalg.inv(poses[own]) @ poses[other])
        momentum -= move @ momenta[other]
        reading = reading + np.square(move) @ np.square(noise.sensors[successor])
    filtered = reading * min(1.0, bandwidth * period / 2)
    return filtered + np.square(bandwidth * momentum).sum(axis=1)


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
        contact = safe if contact is None else contact
        collision = _given(detection.collision, kind, segment)
        if collision is None:
            least = COLLISION_FORCE if is_force else np.inf  # a moment alone is no collision
            collision = max(COLLISION_RATIO * contact, least)
        limit = detection.baseline.limit * contact
        slow, quick = _unknown_errors(max(safe, contact))
        rows.append(RowThreshold(g, component, -1, contact, collision, limit, slow, quick))
    return rows


def _joint_rows(
    robot: Robot, g: int, segment: str, sigma: Array, detection: DetectionDescription
) -> list[RowThreshold]:
    rows = []
    for j, joint in enumerate(robot.description.joints):
        if joint.torque not in ("sensor", "motor") or robot.joint_segments[j] != segment:
            continue
        safe = max(SIGMAS * sigma[j], TORQUE_FLOOR)
        contact = _given(detection.contact, "torque", j)
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
        rows.append(RowThreshold(g, -1, j, contact, collision, limit, slow, quick))
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
