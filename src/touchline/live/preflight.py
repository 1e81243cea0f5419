# SPDX-License-Identifier: Apache-2.0
"""What is checked before a robot goes live: its first second at rest, against its description."""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.detector.thresholds import make_thresholds
from touchline.live.sample import Sample
from touchline.logs.period import typical_period
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.observer.observer import Observer

SECONDS = 1.0  # s that are looked at
LEAST = 20  # samples without which nothing can be said
STILL = 0.03  # rad/s or m/s; an arm that stands, and the noise of an ordinary velocity signal
DRIFTED = 0.02  # rad or m within the second
SLOWEST, FASTEST = 0.05, 5e-5  # s between samples of a robot that can be observed
COARSE = 1.0  # K dt beyond which the observer is far from what it should be
BEYOND = 0.1  # rad or m outside the limits that a zero of an encoder may be off
GROSS = 3.0  # contact thresholds: an offset that calibration takes out is below
SHARE = 0.25  # of the load by the weight: no usable model is worse
TELLING = 1.0  # Nm or N: a load by the weight that tells a sign or a unit
NEAR = 0.15  # of a factor: signs and units are told apart by much more
UNITS = {1e3: "thousandths of it (mNm?)", 1e-3: "thousands of it", 100.0: "hundredths of it"}


@dataclass(frozen=True)
class Reason:
    """Why a robot should not go live.

    Attributes:
        name: rate, channels, units, standstill, signs, order, gravity or model.
        text: what was seen, and what may be done.
    """

    name: str
    text: str

    def __str__(self) -> str:
        return f"{self.name}: {self.text}"


@dataclass(frozen=True)
class _Second:
    """The samples of the check, as arrays."""

    time: Array
    q: Array
    qd: Array
    tau: Array
    wrench: Array

    @classmethod
    def of(cls, samples: list[Sample]) -> "_Second":
        return cls(*(np.array(signal) for signal in zip(*samples, strict=True)))


def preflight(robot: Robot, samples: list[Sample]) -> list[Reason]:
    """Everything that speaks against going live; empty where nothing does.

    Args:
        robot: whose samples these are.
        samples: of about a second in which it stands and nothing touches it.
    """
    if len(samples) < LEAST:
        return [Reason("rate", f"only {len(samples)} samples in {SECONDS:g} s")]
    second = _Second.of(samples)
    reasons = [*_rate(robot, second), *_channels(robot, second)]
    if reasons:
        return reasons
    reasons = [*_units(robot, second), *_standstill(robot, second)]
    return reasons or _loads(robot, second)


def _rate(robot: Robot, second: _Second) -> list[Reason]:
    period = typical_period(second.time)
    if not FASTEST < period < SLOWEST:
        return [
            Reason(
                "rate",
                f"a sample every {period:.4g} s by the sensors' clock; allowed: {FASTEST:g} to "
                f"{SLOWEST:g} s. Is the clock in seconds?",
            )
        ]
    description = robot.description
    bandwidth = max([*description.bandwidth_joints, *description.bandwidth_sensors.values(), 0.0])
    if bandwidth * period > COARSE:
        return [
            Reason(
                "rate",
                f"{1 / period:.0f} Hz is too slow for the observer's bandwidth of {bandwidth:g} "
                f"rad/s; `observer: {{bandwidth: {0.5 / period:.2g}}}` would fit",
            )
        ]
    return []


def _channels(robot: Robot, second: _Second) -> list[Reason]:
    silent = []
    signals = (("q", second.q), ("qd", second.qd), ("tau", second.tau))
    for name, values in signals:
        for j, joint in enumerate(robot.description.joints):
            if (name != "tau" or joint.measured) and not np.isfinite(values[:, j]).any():
                silent.append(f"{name}.{joint.name}")
    for k, sensor in enumerate(robot.description.sensors):
        has = [AXES.index(axis) for axis in sensor.axes]
        if not np.isfinite(second.wrench[:, k, has]).any():
            silent.append(sensor.name)
    return [Reason("channels", f"no number came of {', '.join(silent)}")] if silent else []


def _units(robot: Robot, second: _Second) -> list[Reason]:
    reasons = []
    q, qd = np.nanmedian(second.q, axis=0), np.nanmax(np.abs(second.qd), axis=0)
    for j, name in enumerate(robot.joint_names):
        joint = robot.mechanism.joints[name]
        if not joint.lower - BEYOND <= q[j] <= joint.upper + BEYOND:
            hint = "; in degrees?" if joint.kind == "revolute" and abs(q[j]) > 2 * np.pi else ""
            reasons.append(
                Reason(
                    "units",
                    f"{name} stands at {q[j]:.4g}, outside its range of {joint.lower:.4g} to "
                    f"{joint.upper:.4g}{hint}",
                )
            )
        if np.isfinite(joint.velocity) and qd[j] > 2.0 * max(joint.velocity, 0.1):
            reasons.append(
                Reason("units", f"{name} moves at {qd[j]:.4g}, its limit is {joint.velocity:.4g}")
            )
    return reasons


def _standstill(robot: Robot, second: _Second) -> list[Reason]:
    speed = np.abs(np.nanmedian(second.qd, axis=0))
    way = np.nanmax(second.q, axis=0) - np.nanmin(second.q, axis=0)
    moving = [
        f"{name} ({speed[j]:.2g} a second, {way[j]:.2g} in all)"
        for j, name in enumerate(robot.joint_names)
        if speed[j] > STILL or way[j] > DRIFTED
    ]
    if not moving:
        return []
    return [Reason("standstill", f"the robot moves: {', '.join(moving)}; let it stand for 1 s")]


def _loads(robot: Robot, second: _Second) -> list[Reason]:
    """The loads that nobody applies, against those that the weight explains."""
    period = typical_period(second.time)
    estimate = Observer(robot, bandwidth=min(30.0, 0.4 / period)).run(
        second.time, second.q, second.qd, second.tau, second.wrench
    )
    late = slice(len(second.time) // 2, None)
    q = np.nanmedian(second.q, axis=0)
    weight = robot.terms(q, np.zeros_like(q))[1]
    n = len(robot.joint_names)
    limits = _limits(robot, period)
    torque = np.nanmean(_kept(estimate.tau_ext[late]), axis=0)
    reasons = _order(robot, torque, weight[:n], limits)
    if not reasons:
        for j, joint in enumerate(robot.description.joints):
            if joint.measured:
                reasons += _judge(joint.name, torque[j], weight[j], limits[joint.name], "Nm")
    for k in range(len(robot.sensor_names)):
        wrench = np.nanmean(_kept(estimate.sensor_wrench[late, k]), axis=0)
        reasons += _judge_sensor(robot, k, wrench, weight[n + 6 * k : n + 6 * k + 6], limits)
    # What one reason explains shows in channels of little weight as an unknown one.
    return [reason for reason in reasons if reason.name != "model"] or reasons


def _kept(values: Array) -> Array:
    """Rows of which nothing is known count as zero, so that a mean over them is no warning."""
    return np.where(np.isfinite(values).any(axis=0), values, 0.0)


def _limits(robot: Robot, period: float) -> dict[str, Array | float]:
    """Contact thresholds by joint [Nm], and by sensor (force [N], moment [Nm])."""
    rows = make_thresholds(robot, period).rows
    found: dict[str, Array | float] = {}
    for name in robot.joint_names:
        own = [r.contact for r in rows if r.joint >= 0 and robot.joint_names[r.joint] == name]
        found[name] = own[0] if own else 0.5
    for s in robot.sensor_names:
        own = [r.contact for r in rows if r.joint < 0 and robot.segment_names[r.segment] == s]
        found[s] = np.array([max(own[:3]), max(own[3:])]) if own else np.array([1.0, 0.2])
    return found


def _judge(
    name: str, residual: float, weight: float, threshold: Array | float, unit: str
) -> list[Reason]:
    """One joint: `residual` is what its torque leaves unexplained at rest."""
    limit = GROSS * float(threshold) + SHARE * abs(weight)
    if not abs(residual) > limit:
        return []
    seen, meant = weight - residual, weight
    told = f"{name} shows {seen:.3g} {unit} at rest, its weight needs {meant:.3g} {unit}"
    if abs(weight) > max(TELLING, GROSS * float(threshold)):
        factor = seen / meant
        if abs(factor + 1.0) < NEAR:
            return [Reason("signs", f"{told}: is its sign wrong (`sign: -1`)?")]
        if abs(factor) < NEAR:
            why = "has the driver taken the weight out (`compensated: gravity`)?"
            return [Reason("gravity", f"{told}: {why}")]
        for unit_factor, words in UNITS.items():
            if abs(abs(factor) / unit_factor - 1.0) < NEAR:
                return [Reason("units", f"{told}: in {words}? `gain: {1 / unit_factor:g}`")]
    return [Reason("model", f"{told}: is it touched or loaded, or is the model or a bias wrong?")]


def _order(
    robot: Robot, residual: Array, weight: Array, limits: dict[str, Array | float]
) -> list[Reason]:
    """Two joints whose torques explain each other's weight and not their own."""
    joints = robot.description.joints
    own = [j for j, joint in enumerate(joints) if joint.measured]
    seen = weight - residual

    def fits(j: int, torque: float) -> bool:
        limit = GROSS * float(limits[joints[j].name]) + SHARE * abs(weight[j])
        return abs(torque - weight[j]) <= limit

    bad = [j for j in own if not fits(j, seen[j])]
    if len(bad) != 2:
        return []
    i, j = bad
    if not (fits(i, seen[j]) and fits(j, seen[i])):
        return []
    names = f"{joints[i].name} and {joints[j].name}"
    return [Reason("order", f"the torques of {names} would fit if they were exchanged")]


def _judge_sensor(
    robot: Robot, k: int, residual: Array, weight: Array, limits: dict[str, Array | float]
) -> list[Reason]:
    sensor = robot.description.sensors[k]
    thresholds = np.asarray(limits[sensor.name])
    has = np.array([axis in sensor.axes for axis in AXES])
    parts = ((slice(0, 3), "N", thresholds[0]), (slice(3, 6), "Nm", thresholds[1]))
    for part, unit, threshold in parts:
        left, load = residual[part][has[part]], weight[part][has[part]]
        if not len(left):
            continue
        size = float(np.linalg.norm(load))
        if not np.linalg.norm(left) > GROSS * float(threshold) * np.sqrt(3.0) + SHARE * size:
            continue
        seen = load - left
        told = (
            f"{sensor.name} shows {_numbers(seen)} {unit} at rest, the weight needs "
            f"{_numbers(load)} {unit}"
        )
        return [_sensor_reason(told, seen, load, float(threshold), size, sensor.polarity)]
    return []


def _sensor_reason(
    told: str, seen: Array, load: Array, threshold: float, size: float, polarity: str
) -> Reason:
    if size > max(TELLING, GROSS * threshold):
        factor = float(seen @ load) / size**2
        across = float(np.linalg.norm(seen - factor * load)) / size
        if across < NEAR * max(1.0, abs(factor)):
            if abs(factor + 1.0) < NEAR:
                other = "inboard" if polarity == "outboard" else "outboard"
                return Reason("signs", f"{told}: is its polarity wrong (`polarity: {other}`)?")
            if abs(factor) < NEAR:
                why = "was it zeroed under load, or its weight taken out (`compensated: gravity`)?"
                return Reason("gravity", f"{told}: {why}")
            for unit_factor, words in UNITS.items():
                if abs(abs(factor) / unit_factor - 1.0) < NEAR:
                    return Reason("units", f"{told}: in {words}?")
        if abs(float(np.linalg.norm(seen)) / size - 1.0) < NEAR:
            return Reason("signs", f"{told}: the size is right, so is its frame or pose wrong?")
    return Reason("model", f"{told}: is it touched or loaded, or is the model or a bias wrong?")


def _numbers(values: Array) -> str:
    return "[" + ", ".join(f"{x:.3g}" for x in values) + "]"
