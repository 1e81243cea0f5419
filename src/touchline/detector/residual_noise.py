# SPDX-License-Identifier: Apache-2.0
"""What the noise of the signals leaves in the filtered residuals, at worst over the postures."""

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.native import core

CONFIGURATIONS = 64  # sampled for the largest effect of noise


def native_noise(
    robot: Robot,
    period: float,
    wrench_error: float = 0.0,
    torque_error: float = 0.0,
    wrench_error_off: float = 0.0,
) -> core.NoiseFigures:
    """The noise figures of a robot's description in the words of the native core."""
    noise = robot.description.noise
    sensors = [x for name in robot.sensor_names for x in noise.sensors[name]]
    return core.noise_figures(
        list(noise.qd),
        list(noise.tau),
        sensors,
        period,
        wrench_error,
        torque_error,
        wrench_error_off,
    )


def residual_noise(robot: Robot, period: float) -> tuple[Array, dict[str, Array]]:
    """Standard deviations of the filtered residuals, the largest over sampled configurations.

    Noise per sample of readings is low-passed, factor sqrt(K dt / 2); velocity noise enters
    through the momentum as K times the momentum it makes (theory: K M sigma_qd). A joint's
    residual is that of its own segment: the noise of six-axis sensors outboard, which tell what
    lies beyond, is in it with their distance from the axis.

    Returns:
        (n,) [Nm] for the joints and per segment (6,) [N, Nm] in its sensor's frame.
    """
    n = len(robot.joint_names)
    segments = [name for name in robot.segment_names if name != "root"]
    indices = [robot.segment_names.index(name) for name in segments]
    rows = [_row(0, -1, j) for j in range(n)]
    rows += [_row(g, axis, -1) for g in indices for axis in range(6)]
    K = np.array(
        [*robot.description.bandwidth_joints]
        + [robot.description.bandwidth_sensors[name] for name in segments for _ in range(6)]
    )
    noise, kernel = native_noise(robot, period), robot.kernel()
    worst = np.zeros(len(rows))
    for q in np.random.default_rng(0).uniform(*robot.ranges, (CONFIGURATIONS, n)):
        reading, momentum = core.row_variances(kernel, rows, noise, q)
        worst = np.maximum(worst, reading * np.minimum(1.0, K * period / 2) + K**2 * momentum)
    sigma = np.sqrt(worst)
    return sigma[:n], dict(zip(segments, sigma[n:].reshape(-1, 6), strict=True))


def _row(segment: int, component: int, joint: int) -> core.DetectionRow:
    """Neither thresholds nor the segment of a joint's row matter here."""
    none = [0.0] * 3
    return core.DetectionRow(segment, component, joint, 1.0, 1.0, 1.0, none, none, none)
