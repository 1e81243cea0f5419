# SPDX-License-Identifier: Apache-2.0
"""What the noise of the signals leaves in the filtered residuals, at worst over the postures."""

import numpy as np
from numpy.typing import NDArray

from touchline.model.robot import Robot
from touchline.model.transforms import move_wrench

Array = NDArray[np.float64]

CONFIGURATIONS = 64  # sampled for the largest effect of velocity noise


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
        columns = np.array(momenta).reshape(n, n + 6 * k).T
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
