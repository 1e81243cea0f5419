# SPDX-License-Identifier: Apache-2.0
"""A fast motion with a known push, as ideal sensors report it."""

from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot, load_robot
from touchline.observer.dynamics import contact_loads, inverse_dynamics

PUSH = np.array([12.0, -8.0, 15.0])  # [N], world axes
POINT = np.array([0.1, 0.2, 0.4])  # [m], fixed in world
ONSET, RAMP = 0.25, 0.125  # [s]; both are whole numbers of samples at 1 and at 8 kHz


@dataclass(frozen=True)
class Motion:
    """N samples of a motion with exact loads, and the truth behind them.

    Attributes:
        time: (N,) [s].
        q: (N, n) [rad].
        qd: (N, n) [rad/s].
        qdd: (N, n) [rad/s2].
        tau: (N, n) [Nm].
        wrench: (N, k, 6) [N, Nm].
        tau_ext: (N, n) [Nm], the push on the joints.
        sensor_ext: (N, k, 6) [N, Nm], the push on what is outboard of each sensor.
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    tau: Array
    wrench: Array
    tau_ext: Array
    sensor_ext: Array

    def signals(self) -> tuple[Array, Array, Array, Array, Array]:
        """What an observer gets: time, q, qd, tau, wrench."""
        return self.time, self.q, self.qd, self.tau, self.wrench


def fast_motion(robot: Robot, rate: float, duration: float = 1.0) -> Motion:
    """Sines up to some 3 rad/s in every joint, and a push in the middle of the arm.

    Args:
        robot: the robot.
        rate: samples per second [Hz].
        duration: length [s].
    """
    time = np.arange(round(rate * duration)) / rate
    n = len(robot.joint_names)
    rng = np.random.default_rng(0)
    frequency, amplitude = rng.uniform(2.0, 5.0, n), rng.uniform(0.3, 0.7, n)
    angle = time[:, None] * frequency + rng.uniform(0.0, 6.0, n)
    q = amplitude * np.sin(angle)
    qd = amplitude * frequency * np.cos(angle)
    qdd = -amplitude * frequency**2 * np.sin(angle)
    needed = inverse_dynamics(robot, q, qd, qdd)
    force = np.clip((time - ONSET) / RAMP, 0.0, 1.0)[:, None] * PUSH
    push = np.hstack([force, np.cross(POINT, force)])
    contact = contact_loads(robot, q, pushed_link(robot), push)
    tau, wrench = needed.torque - contact.torque, needed.wrench - contact.wrench
    return Motion(time, q, qd, qdd, tau, wrench, contact.torque, contact.wrench)


def pushed_link(robot: Robot) -> str:
    """Where the push acts: the link that the middle one of the joints carries."""
    name = robot.joint_names[len(robot.joint_names) // 2]
    return robot.mechanism.joints[name].child


def two_sensor_arm(bandwidth: float = 100.0) -> Robot:
    """`sara-full` with the sensors at base and wrist alone.

    Args:
        bandwidth: K [rad/s] of all rows.
    """
    full = load_robot("sara-full")
    sensors = full.description.sensors[:2]
    description = replace(
        full.description,
        sensors=sensors,
        bandwidth_joints=(bandwidth,) * len(full.joint_names),
        bandwidth_sensors={sensor.name: bandwidth for sensor in sensors},
    )
    return Robot(description, full.mechanism)
