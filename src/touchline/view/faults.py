# SPDX-License-Identifier: Apache-2.0
"""What a visitor can do to the sensors."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

OFFSET, TORQUE_OFFSET = 5.0, 3.0  # N, Nm
DRIFT, LARGEST_DRIFT = 1.0, 10.0  # N/s, N
SPIKE, SPIKE_SHARE = 300.0, 0.01  # N, of the samples
DELAY = 0.02  # s


class SensorFault:
    """A fault that goes on from one part of the samples to the next.

    Args:
        robot: with the sensors `base`, `wrist` and `handle`, and `joint3`.
        name: one of `FAULTS`.
        rng: for spikes.
    """

    def __init__(self, robot: Robot, name: str, rng: np.random.Generator) -> None:
        self._sensor = {sensor: i for i, sensor in enumerate(robot.sensor_names)}
        self._joint = {joint: i for i, joint in enumerate(robot.joint_names)}
        self._disturb, self._rng = FAULTS[name], rng
        self.since: float | None = None
        self._past: Array | None = None

    def apply(self, samples: Samples) -> Samples:
        """What is logged in place of `samples`."""
        if self.since is None:
            self.since = float(samples.time[0])
        tau, wrench = samples.tau.copy(), samples.wrench.copy()
        self._disturb(self, samples.time, tau, wrench)
        return replace(samples, tau=tau, wrench=wrench)

    def nothing(self, time: Array, tau: Array, wrench: Array) -> None:
        """All is well."""

    def wrist_offset(self, time: Array, tau: Array, wrench: Array) -> None:
        """The zero of one axis is wrong."""
        wrench[:, self._sensor["wrist"], 0] += OFFSET

    def wrist_silent(self, time: Array, tau: Array, wrench: Array) -> None:
        """The cable is out."""
        wrench[:, self._sensor["wrist"]] = np.nan

    def wrist_spikes(self, time: Array, tau: Array, wrench: Array) -> None:
        """Single samples are nonsense."""
        hit = self._rng.random(len(time)) < SPIKE_SHARE
        wrench[hit, self._sensor["wrist"]] += SPIKE * self._rng.normal(size=(int(hit.sum()), 6))

    def base_drift(self, time: Array, tau: Array, wrench: Array) -> None:
        """The zero wanders, as with temperature."""
        drift = np.minimum(DRIFT * (time - (self.since or 0.0)), LARGEST_DRIFT)
        wrench[:, self._sensor["base"], 2] += drift

    def handle_late(self, time: Array, tau: Array, wrench: Array) -> None:
        """The signal takes a detour."""
        sensor = self._sensor["handle"]
        now = np.column_stack([time, wrench[:, sensor]])
        past = now[:1] if self._past is None else self._past
        known = np.vstack([past, now])
        for axis in range(6):
            wrench[:, sensor, axis] = np.interp(time - DELAY, known[:, 0], known[:, axis + 1])
        self._past = known[known[:, 0] >= time[-1] - 2 * DELAY]

    def torque_offset(self, time: Array, tau: Array, wrench: Array) -> None:
        """A strain gauge has slipped."""
        tau[:, self._joint["joint3"]] += TORQUE_OFFSET

    def torque_silent(self, time: Array, tau: Array, wrench: Array) -> None:
        """A torque sensor is dead."""
        tau[:, self._joint["joint3"]] = np.nan


FAULTS: dict[str, Callable[[SensorFault, Array, Array, Array], None]] = {
    "none": SensorFault.nothing,
    "wrist sensor: 5 N offset": SensorFault.wrist_offset,
    "wrist sensor: silent": SensorFault.wrist_silent,
    "wrist sensor: spikes": SensorFault.wrist_spikes,
    "base sensor: drifts to 10 N": SensorFault.base_drift,
    "handle sensor: 20 ms late": SensorFault.handle_late,
    "joint 3: 3 Nm offset": SensorFault.torque_offset,
    "joint 3: silent": SensorFault.torque_silent,
}


def faults_of(robot: Robot) -> tuple[str, ...]:
    """The faults that a robot's sensors and joints can have."""
    sensors = {f"{name} sensor" for name in robot.sensor_names}
    known = sensors | ({"joint 3"} if "joint3" in robot.joint_names else set())
    return tuple(name for name in FAULTS if name == "none" or name.partition(":")[0] in known)
