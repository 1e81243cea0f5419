# SPDX-License-Identifier: Apache-2.0
"""The white noise of signals, beneath whatever motion they show."""

from collections.abc import Iterable
from math import comb

import numpy as np
from numpy.typing import NDArray

from touchline.model.description import AXES, Noise
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

Array = NDArray[np.float64]

ORDER = 3  # of the differences: they take out what is smooth over four samples
FAR = 8.0  # differences so many robust sigmas out are jumps, not noise


class NoiseMeter:
    """Sums up the squared differences of a signal (N, columns), part by part."""

    def __init__(self, columns: int) -> None:
        self._sum, self._count = np.zeros(columns), np.zeros(columns)

    def add(self, values: Array) -> None:
        """Takes the next evenly sampled rows; NaN where nothing was measured."""
        if len(values) <= ORDER:
            return
        d = np.diff(values, ORDER, axis=0)
        known = np.isfinite(d)
        squares = np.where(known, d, 0.0) ** 2
        for j in np.flatnonzero(known.any(axis=0)):
            own = squares[known[:, j], j]
            typical = float(np.median(own)) / 0.455  # of the square of a normal variable
            near = own <= FAR**2 * typical if typical > 0 else np.ones(len(own), bool)
            self._sum[j] += own[near].sum()
            self._count[j] += near.sum()

    def sigma(self) -> Array:
        """1 sigma per sample (columns,); NaN where there was no signal.

        A difference of order d of white noise has the variance sigma^2 times binom(2 d, d).
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(self._sum / self._count / comb(2 * ORDER, ORDER))


def measure_noise(robot: Robot, recordings: Iterable[Iterable[Samples]]) -> Noise:
    """Noise figures of a robot's signals; those that were not logged keep what the robot says."""
    n, k = len(robot.joint_names), len(robot.sensor_names)
    qd, tau, wrench = NoiseMeter(n), NoiseMeter(n), NoiseMeter(6 * k)
    for recording in recordings:
        for s in recording:
            qd.add(s.qd)
            tau.add(s.tau)
            wrench.add(s.wrench.reshape(len(s.time), -1))
    given = robot.description.noise
    gains = np.array([joint.gain for joint in robot.description.joints])
    sensors = {
        name: _filled(wrench.sigma().reshape(k, 6)[s], given.sensors[name])
        for s, name in enumerate(robot.sensor_names)
    }
    return Noise(
        given.q, _filled(qd.sigma(), given.qd), _filled(tau.sigma() * gains, given.tau), sensors
    )


def noise_keys(robot: Robot, noise: Noise) -> dict:
    """As it stands in `robot.yaml`, key `noise`."""
    keys: dict = {"q": _short(noise.q), "qd": _short(noise.qd)}
    if any(joint.measured for joint in robot.description.joints):
        keys["tau"] = _short(noise.tau)
    for sensor in robot.description.sensors:
        six = noise.sensors[sensor.name]
        keys[sensor.name] = [six[AXES.index(axis)] for axis in sensor.axes]
    return keys


def _short(values: tuple[float, ...]) -> float | list[float]:
    return values[0] if len(set(values)) == 1 else list(values)


def _filled(found: Array, given: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(
        float(f"{x:.3g}") if np.isfinite(x) else y for x, y in zip(found, given, strict=True)
    )
