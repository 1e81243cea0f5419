# SPDX-License-Identifier: Apache-2.0
"""Noise figures of a robot from recordings, as `robot.yaml` has them."""

from collections.abc import Iterable

import numpy as np

from touchline.arrays import Array
from touchline.identify.noise_meter import NoiseMeter
from touchline.model.description import AXES, Noise
from touchline.model.robot import Robot
from touchline.observer.samples import Samples


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
