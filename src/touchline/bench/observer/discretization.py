# SPDX-License-Identifier: Apache-2.0
"""What the discretization of eq. (15) costs: force error of a base sensor on a fast motion.

Four ways to turn momentum `p` and known load `u = w - n` at the samples into the residual. Euler's
and the rectangle form are what public code mostly uses; the other two are the observer's own.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.observer.observer import Observer
from touchline.trials.fast_motion import Motion, fast_motion


@dataclass(frozen=True)
class DiscretizationError:
    """Largest force error [N] of the base sensor against the exactly filtered push."""

    name: str
    rate: float
    force: float


def discretization_errors(
    robot: Robot, bandwidth: float = 50.0, rates: tuple[float, ...] = (1000.0, 8000.0)
) -> list[DiscretizationError]:
    """Errors of the four forms at each rate [Hz]; empty if no sensor stands still at the base.

    Args:
        robot: the robot.
        bandwidth: K [rad/s].
        rates: sample rates [Hz].
    """
    sensor = fixed_sensor(robot)
    if sensor is None:
        return []
    errors = []
    for rate in rates:
        motion = fast_motion(robot, rate)
        truth = filtered(motion.sensor_ext[:, sensor], bandwidth, 1.0 / rate)
        for name, residual in _residuals(robot, motion, sensor, bandwidth).items():
            worst = np.linalg.norm((residual - truth)[:, :3], axis=1).max()
            errors.append(DiscretizationError(name, rate, float(worst)))
    return errors


def fixed_sensor(robot: Robot) -> int | None:
    """The first six-axis sensor with no moving joint inboard of it."""
    for s, sensor in enumerate(robot.description.sensors):
        node = next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor.name)
        while node >= 0 and robot.nodes[node].coordinate < 0:
            node = robot.nodes[node].parent
        if node < 0 and len(sensor.axes) == 6:
            return s
    return None


def filtered(signal: Array, bandwidth: float, dt: float) -> Array:
    """The exact first-order low-pass (eq. 17) of a signal (N, m) linear between its samples."""
    a = np.exp(-bandwidth * dt)
    k = (1.0 - a) / (bandwidth * dt)
    out = np.zeros_like(signal)
    for i in range(1, len(signal)):
        out[i] = a * out[i - 1] + (k - a) * signal[i - 1] + (1.0 - k) * signal[i]
    return out


def euler(p: Array, u: Array, bandwidth: float, dt: float) -> Array:
    """Explicit Euler of eq. (15): a growing integral of `u + r`."""
    r, integral = np.zeros_like(p), np.zeros_like(p[0])
    for i in range(1, len(p)):
        integral += (u[i] + r[i - 1]) * dt
        r[i] = bandwidth * (p[i] - integral - p[0])
    return r


def rectangle(p: Array, u: Array, bandwidth: float, dt: float) -> Array:
    """The exact pole, but `u` at one end of the interval for its mean."""
    a = np.exp(-bandwidth * dt)
    r = np.zeros_like(p)
    for i in range(1, len(p)):
        r[i] = a * r[i - 1] + (1.0 - a) * ((p[i] - p[i - 1]) / dt - u[i])
    return r


FORMS: dict[str, Callable[[Array, Array, float, float], Array]] = {
    "Euler": euler,
    "rectangle": rectangle,
}
OWN = {"exponential-trapezoid": "exponential", "Tustin": "tustin"}


def _residuals(robot: Robot, motion: Motion, sensor: int, bandwidth: float) -> dict[str, Array]:
    """The sensor's residual (N, 6) by each form."""
    start = len(robot.joint_names) + 6 * sensor
    terms = [robot.terms(*state) for state in zip(motion.q, motion.qd, strict=True)]
    p = np.array([momentum[start : start + 6] for momentum, _ in terms])
    u = motion.wrench[:, sensor] - np.array([n_bar[start : start + 6] for _, n_bar in terms])
    dt = float(motion.time[1] - motion.time[0])
    found = {name: form(p, u, bandwidth, dt) for name, form in FORMS.items()}
    for name, rule in OWN.items():
        run = Observer(robot, bandwidth=bandwidth, discretization=rule).run(*motion.signals())
        found[name] = run.sensor_wrench[:, sensor]
    return found
