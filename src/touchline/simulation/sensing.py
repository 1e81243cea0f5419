# SPDX-License-Identifier: Apache-2.0
"""From ideal readings to what a robot logs: conventions of its description, noise, faults."""

from dataclasses import replace

import numpy as np

from touchline.arrays import Array
from touchline.model.description import AXES, JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.simulation.noise import SensorNoise, delayed
from touchline.simulation.readings import Readings


def sense(
    robot: Robot,
    readings: Readings,
    noise: SensorNoise | None = None,
    rng: np.random.Generator | None = None,
) -> Samples:
    """What the robot logs, such that its description reads it back.

    Args:
        robot: whose description says signs, gains, axes, frames, compensation, delays.
        readings: of ideal sensors, evenly spaced in time.
        noise: of the sensors; default: none.
        rng: for the noise.
    """
    if noise is not None:
        readings = noise.disturb(robot, readings, rng or np.random.default_rng(0))
    description = robot.description
    tau = np.column_stack(
        [_joint_log(joint, j, readings) for j, joint in enumerate(description.joints)]
    )
    wrench = np.empty_like(readings.wrench)
    for s, sensor in enumerate(description.sensors):
        wrench[:, s] = _sensor_log(sensor, s, readings)
    samples = Samples(readings.time, readings.q, readings.qd, tau, wrench)
    if noise is None:
        return samples
    return replace(samples, **noise.drop(samples, rng or np.random.default_rng(0)))


def _joint_log(joint: JointDescription, j: int, readings: Readings) -> Array:
    """The inverse of `torque = sign * gain * logged - bias - friction`."""
    if not joint.measured:
        return np.full(len(readings.time), np.nan)
    if joint.torque == "motor":
        shown = readings.motor_torque[:, j]
    else:
        friction, qd = joint.friction, readings.qd[:, j]
        shown = readings.link_torque[:, j] + friction.viscous * qd
        shown = shown + friction.dry(qd)
    if joint.compensated == "gravity" and readings.gravity_torque is not None:
        shown = shown - readings.gravity_torque[:, j]
    elif joint.compensated == "model" and readings.motion_torque is not None:
        shown = shown - readings.motion_torque[:, j]
    reading = joint.sign * (shown + joint.bias)
    logged = np.clip(reading, -joint.range, joint.range) / joint.gain
    return delayed(readings.time, logged, joint.delay)


def _sensor_log(sensor: SensorDescription, s: int, readings: Readings) -> Array:
    """The wrench (N, 6) as the sensor's log gives it; axes that it lacks are NaN."""
    wrench = readings.wrench[:, s]
    if sensor.compensated == "gravity" and readings.weight is not None:
        wrench = wrench + readings.weight[:, s]
    sign = 1.0 if sensor.polarity == "outboard" else -1.0
    limit = np.asarray(sensor.range)
    shown = np.clip(sign * (wrench + np.asarray(sensor.bias)), -limit, limit)
    if sensor.frame != "sensor" and readings.R_log_sensor is not None:
        R = readings.R_log_sensor[:, s]
        shown = np.einsum("nij,naj->nai", R, shown.reshape(-1, 2, 3)).reshape(-1, 6)
    shown = delayed(readings.time, shown, sensor.delay)
    shown[:, [axis not in sensor.axes for axis in AXES]] = np.nan
    return shown
