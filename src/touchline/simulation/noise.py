# SPDX-License-Identifier: Apache-2.0
"""What real sensors add to ideal readings."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from touchline.arrays import Array, Mask
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.simulation.readings import Readings

NOISE_RATE = 1000.0  # Hz at which the sigmas hold; white noise grows with the root of the rate


@dataclass(frozen=True)
class SensorNoise:
    """Noise and faults of the sensors; all but the white noise is off by default.

    Attributes:
        force, moment: white noise of a wrench, 1 sigma per sample at 1 kHz [N, Nm].
        torque: of a joint torque [Nm].
        velocity: of a joint velocity [rad/s].
        position_bits: of a revolute joint's position, per turn; 0: exact.
        force_bias, moment_bias, torque_bias: 1 sigma of an offset drawn once [N, Nm, Nm].
        force_drift, moment_drift, torque_drift: 1 sigma of a random walk after 1 s.
        crosstalk: 1 sigma of what an axis shows of each other axis, after scaling moments to
            forces by `crosstalk_length`.
        crosstalk_length: [m].
        wrench_delay, torque_delay: by which signals are late, unknown to the description [s].
        dropout_rate: how often a sensor falls silent [1/s].
        dropout_time: for how long, on average [s].
    """

    force: float = 0.05
    moment: float = 0.01
    torque: float = 0.05
    velocity: float = 2e-4
    position_bits: int = 20
    force_bias: float = 0.0
    moment_bias: float = 0.0
    torque_bias: float = 0.0
    force_drift: float = 0.0
    moment_drift: float = 0.0
    torque_drift: float = 0.0
    crosstalk: float = 0.0
    crosstalk_length: float = 0.1
    wrench_delay: float = 0.0
    torque_delay: float = 0.0
    dropout_rate: float = 0.0
    dropout_time: float = 0.02

    def disturb(self, robot: Robot, readings: Readings, rng: np.random.Generator) -> Readings:
        """Readings with noise, offsets, drift, cross-talk and delay."""
        time = readings.time
        wrench = delayed(time, self._mixed(readings.wrench, rng), self.wrench_delay)
        wrench = wrench + self._six(time, wrench.shape, rng)
        torques = {}
        noise = self._signal(
            time, readings.link_torque.shape, rng, self.torque, self.torque_bias, self.torque_drift
        )
        for name in ("link_torque", "motor_torque"):
            torques[name] = delayed(time, getattr(readings, name), self.torque_delay) + noise
        qd = readings.qd + self._white(time, readings.qd.shape, rng, self.velocity)
        q = self.quantized(robot, readings.q)
        return replace(readings, q=q, qd=qd, wrench=wrench, **torques)

    def drop(self, samples: Samples, rng: np.random.Generator) -> dict[str, Any]:
        """Signals `tau` and `wrench` with NaN where a sensor is silent."""
        if self.dropout_rate == 0.0:
            return {}
        tau, wrench = samples.tau.copy(), samples.wrench.copy()
        for column in (*(tau[:, j] for j in range(tau.shape[1])), *np.swapaxes(wrench, 0, 1)):
            column[self._silent(samples.time, rng)] = np.nan
        return {"tau": tau, "wrench": wrench}

    def _silent(self, time: Array, rng: np.random.Generator) -> Mask:
        span = float(time[-1] - time[0])
        starts = time[0] + rng.uniform(0, span, rng.poisson(self.dropout_rate * span))
        lengths = rng.exponential(self.dropout_time, len(starts))
        silent = np.zeros(len(time), dtype=bool)
        for start, length in zip(starts, lengths, strict=True):
            silent |= (time >= start) & (time < start + length)
        return silent

    def _six(self, time: Array, shape: tuple[int, ...], rng: np.random.Generator) -> Array:
        half = (*shape[:-1], 3)
        force = self._signal(time, half, rng, self.force, self.force_bias, self.force_drift)
        moment = self._signal(time, half, rng, self.moment, self.moment_bias, self.moment_drift)
        return np.concatenate([force, moment], axis=-1)

    def _signal(
        self,
        time: Array,
        shape: tuple[int, ...],
        rng: np.random.Generator,
        white: float,
        bias: float,
        drift: float,
    ) -> Array:
        out = self._white(time, shape, rng, white) + bias * rng.normal(size=shape[1:])
        if drift:
            steps = np.sqrt(np.diff(time, prepend=time[0]))
            out = out + drift * np.cumsum(
                steps.reshape(-1, *[1] * (len(shape) - 1)) * rng.normal(size=shape), axis=0
            )
        return out

    def _white(
        self, time: Array, shape: tuple[int, ...], rng: np.random.Generator, sigma: float
    ) -> Array:
        rate = 1.0 / np.median(np.diff(time)) if len(time) > 1 else NOISE_RATE
        return sigma * np.sqrt(rate / NOISE_RATE) * rng.normal(size=shape)

    def _mixed(self, wrench: Array, rng: np.random.Generator) -> Array:
        if self.crosstalk == 0.0:
            return wrench
        unit = np.array([1.0] * 3 + [self.crosstalk_length] * 3)
        mix = self.crosstalk * rng.normal(size=(wrench.shape[1], 6, 6))
        mix[:, range(6), range(6)] = 0.0
        mix = mix * unit[:, None] / unit[None, :]
        return wrench + np.einsum("kij,nkj->nki", mix, wrench)

    def quantized(self, robot: Robot, q: Array) -> Array:
        """Positions (N, n) as encoders of `position_bits` report them [rad or m]."""
        if self.position_bits == 0:
            return q
        joints = robot.mechanism.joints
        turning = np.array([joints[name].kind == "revolute" for name in robot.joint_names])
        step = 2 * np.pi / 2**self.position_bits
        return np.where(turning, step * np.round(q / step), q)


def delayed(time: Array, values: Array, delay: float) -> Array:
    """What is logged at t when it is `delay` [s] late: linear between samples, held at the start.

    Args:
        time: (N,) [s].
        values: (N, ...).
        delay: [s].
    """
    if delay == 0.0:
        return np.array(values)
    flat = values.reshape(len(time), -1)
    late = [np.interp(time - delay, time, column) for column in flat.T]
    return np.column_stack(late).reshape(values.shape)
