# SPDX-License-Identifier: Apache-2.0
"""When a residual counts as a contact: thresholds from the noise figures or from `detection`."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.model.description import DetectionDescription, LevelDescription
from touchline.model.robot import Robot
from touchline.model.transforms import move_wrench

Array = NDArray[np.float64]

SIGMAS = 6.0  # contact thresholds lie this many standard deviations of the residual out
CONFIGURATIONS = 64  # sampled for the largest effect of velocity noise
FORCE_FLOOR, MOMENT_FLOOR, TORQUE_FLOOR = 0.5, 0.1, 0.1  # N, Nm, Nm: models are not better
COLLISION_RATIO = 4.0
COLLISION_FORCE = 15.0  # N; below it nothing is called a collision unless the user says so
COLLISION_EFFORT = 0.2  # of a joint's effort limit


@dataclass(frozen=True)
class RowThreshold:
    """The test of one residual: a component (0-5) of a segment's wrench, or a joint's torque.

    `contact`, `collision` and `baseline_limit` are in N or Nm; wrenches are those in the frame of
    the segment's own sensor. A joint row has component -1, a wrench row has joint -1.
    """

    segment: int
    component: int
    joint: int
    contact: float
    collision: float
    baseline_limit: float


@dataclass(frozen=True)
class Thresholds:
    """All tests of a robot, and per segment the limit (m,) of the sum of squared rows."""

    rows: tuple[RowThreshold, ...]
    sum_limit: Array


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
    from scipy.special import chdtri, erfc  # slow to import

    joint_sigma, segment_sigma = residual_noise(robot, period)
    rows: list[RowThreshold] = []
    for g, segment in enumerate(robot.segment_names):
        if segment != "root":
            rows += _wrench_rows(g, segment, segment_sigma[segment], detection)
        rows += _joint_rows(robot, g, segment, joint_sigma, detection)
    counts = np.bincount([row.segment for row in rows], minlength=len(robot.segment_names))
    alarm = erfc(SIGMAS / np.sqrt(2))  # of one row: a normal variable beyond +-SIGMAS
    return Thresholds(tuple(rows), chdtri(np.maximum(counts, 1), alarm) / SIGMAS**2)


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
        contact = _given(detection.contact, kind, segment)
        contact = max(SIGMAS * sigma[component], floor) if contact is None else contact
        collision = _given(detection.collision, kind, segment)
        if collision is None:
            least = COLLISION_FORCE if is_force else np.inf  # a moment alone is no collision
            collision = max(COLLISION_RATIO * contact, least)
        limit = detection.baseline.limit * contact
        rows.append(RowThreshold(g, component, -1, contact, collision, limit))
    return rows


def _joint_rows(
    robot: Robot, g: int, segment: str, sigma: Array, detection: DetectionDescription
) -> list[RowThreshold]:
    rows = []
    for j, joint in enumerate(robot.description.joints):
        if joint.torque not in ("sensor", "motor") or robot.joint_segments[j] != segment:
            continue
        contact = _given(detection.contact, "torque", j)
        contact = max(SIGMAS * sigma[j], TORQUE_FLOOR) if contact is None else contact
        collision = _given(detection.collision, "torque", j)
        if collision is None:
            effort = robot.mechanism.joints[joint.name].effort
            least = COLLISION_EFFORT * effort if np.isfinite(effort) else 0.0
            collision = max(COLLISION_RATIO * contact, least)
        rows.append(RowThreshold(g, -1, j, contact, collision, detection.baseline.limit * contact))
    return rows


def _given(level: LevelDescription, kind: str, key: str | int) -> float | None:
    """What the description says: one number, one per joint, or one per sensor; None if nothing."""
    value = getattr(level, kind)
    if isinstance(value, dict):
        return value.get(key)
    if isinstance(value, tuple):
        return value[int(key)]
    return value
