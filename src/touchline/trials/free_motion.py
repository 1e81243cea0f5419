# SPDX-License-Identifier: Apache-2.0
"""Hours of contact-free motion: prescribed, with exact loads of an arm that is not as modelled.

No physics engine: the loads are those of inverse dynamics with perturbed inertias. All of it is
smooth, and is computed at a low rate and interpolated by polynomials: positions and velocities to
1e-9, loads to 1e-5 N of 500. Noise is added per sample.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import ceil

import numpy as np
from scipy.interpolate import CubicSpline

from touchline.arrays import Array
from touchline.calibrate.plan import Plan
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.dynamics import inverse_dynamics
from touchline.observer.samples import Samples

# Positions, velocities, accelerations (N, n) at times (N,).
Path = Callable[[Array], tuple[Array, Array, Array]]

WAVES = 3  # per joint
FREQUENCIES = 0.15, 0.6  # Hz, of the waves
SLOWEST, FASTEST = 0.5, 3.0  # rad/s
COARSE = 50.0  # Hz, at which loads are computed
POINTS = np.arange(-3, 5)  # of these that a polynomial of degree 7 goes through


@dataclass(frozen=True)
class Trajectory:
    """Waves along a path that is followed at a varying pace, down to rest now and then.

    Attributes:
        center: (n,) [rad].
        amplitude, frequency, phase: (WAVES, n) [rad, rad/s, rad].
        pace: frequency [rad/s] and phase [rad] of the pace, 0 to 1.
    """

    center: Array
    amplitude: Array
    frequency: Array
    phase: Array
    pace: tuple[float, float]

    def __call__(self, time: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities, accelerations (N, n) at times (N,) [s]."""
        w, phase = self.pace
        s = 0.5 * (time + (np.sin(w * time + phase) - np.sin(phase)) / w)
        s1, s2 = 0.5 * (1.0 + np.cos(w * time + phase)), -0.5 * w * np.sin(w * time + phase)
        q = np.tile(self.center, (len(time), 1))
        slope, curvature = np.zeros_like(q), np.zeros_like(q)
        for a, f, p in zip(self.amplitude, self.frequency, self.phase, strict=True):
            angle = np.multiply.outer(s, f) + p
            sine = np.sin(angle)
            q += a * sine
            slope += a * f * np.cos(angle)
            curvature -= a * f**2 * sine
        return q, slope * s1[:, None], curvature * s1[:, None] ** 2 + slope * s2[:, None]


def random_trajectory(
    robot: Robot, rng: np.random.Generator, fastest: float = FASTEST
) -> Trajectory:
    """A motion within joint limits whose fastest joint reaches SLOWEST to `fastest` [rad/s]."""
    n = len(robot.joint_names)
    lower, upper = robot.ranges
    frequency = 2 * np.pi * rng.uniform(*FREQUENCIES, (WAVES, n))
    amplitude = rng.uniform(0.2, 1.0, (WAVES, n)) / frequency
    speed = (amplitude * frequency).sum(axis=0)
    amplitude *= rng.uniform(SLOWEST, fastest) / speed.max()
    reach = amplitude.sum(axis=0)
    amplitude *= np.minimum(1.0, 0.45 * (upper - lower) / reach)
    reach = amplitude.sum(axis=0)
    center = rng.uniform(lower + reach, upper - reach)
    pace = 2 * np.pi * rng.uniform(0.08, 0.25), rng.uniform(0, 2 * np.pi)
    return Trajectory(center, amplitude, frequency, rng.uniform(0, 2 * np.pi, (WAVES, n)), pace)


def planned(plan: Plan) -> Path:
    """The planned motion, which rests before and after."""
    curve = CubicSpline(plan.time, plan.q, bc_type="clamped")

    def at(time: Array) -> tuple[Array, Array, Array]:
        inside = np.clip(time, 0.0, plan.time[-1])
        moving = (inside == time)[:, None]
        return curve(inside), curve(inside, 1) * moving, curve(inside, 2) * moving

    return at


def imperfect(robot: Robot, error: float, seed: int) -> Robot:
    """The arm that moves: inertias that are off by `error` (1 sigma) from what `robot` says."""
    rng = np.random.default_rng(seed)
    return Robot(robot.description, perturbed(robot.mechanism, error, rng))


def with_noise(robot: Robot, velocity: float) -> Robot:
    """The robot with another velocity noise [rad/s], 1 sigma per sample."""
    noise = replace(robot.description.noise, qd=(velocity,) * len(robot.joint_names))
    return Robot(replace(robot.description, noise=noise), robot.mechanism)


class MotionMaker:
    """Makes recordings of an arm, as its sensors report them.

    Args:
        robot: the description, whose noise figures the sensors have.
        arm: the arm that moves (see `imperfect`).
        rate: samples per second [Hz], a multiple of COARSE.
        seconds: length of a recording.

    Attributes:
        time: of the samples [s].
        coarse: times [s] that loads are computed at, some before and after the recording, too.
        factor: samples from one of them to the next.
    """

    def __init__(self, robot: Robot, arm: Robot, rate: float, seconds: float = 60.0) -> None:
        self.robot, self.arm, self.rate = robot, arm, rate
        self.factor = round(rate / COARSE)
        self.time = np.arange(round(seconds * rate)) / rate
        half, count = len(POINTS) // 2, -(-len(self.time) // self.factor)
        self.coarse = (np.arange(count + 2 * half) - (half - 1)) / COARSE
        self._weights = _lagrange(np.arange(self.factor) / self.factor)

    def loads(self, trajectory: Path) -> tuple[Array, Array, Array]:
        """Positions, velocities and what ideal sensors read (N, n + 6 k): torques, wrenches."""
        q, qd, qdd = trajectory(self.coarse)
        needed, n = inverse_dynamics(self.arm, q, qd, qdd), q.shape[1]
        values = np.hstack([q, qd, needed.torque, needed.wrench.reshape(len(q), -1)])
        fine = self.interpolated(values, slice(0, len(self.time)))
        return fine[:, :n], fine[:, n : 2 * n], fine[:, 2 * n :]

    def interpolated(self, values: Array, rows: slice) -> Array:
        """Smooth values, given at the times `coarse` (C, c), at some samples (N, c).

        `rows` are those samples; they begin at a multiple of `factor`.
        """
        first, count = rows.start // self.factor, -(-(rows.stop - rows.start) // self.factor)
        near = np.stack([values[first + k : first + k + count] for k in range(len(POINTS))])
        fine = np.tensordot(self._weights, near, axes=(1, 0)).transpose(1, 0, 2)
        return fine.reshape(-1, values.shape[1])[: rows.stop - rows.start]

    def around(self, start: float, end: float) -> tuple[slice, slice]:
        """Samples between two times [s] and some more, and those of `coarse` they are made from."""
        first, last = int(start * COARSE), min(ceil(end * COARSE), len(self.time) // self.factor)
        rows = slice(first * self.factor, last * self.factor)
        return rows, slice(first, last + len(POINTS) - 1)

    def samples(self, trajectory: Trajectory, rng: np.random.Generator) -> Samples:
        """A recording without contact."""
        return self.sensed(*self.loads(trajectory), rng)

    def sensed(self, q: Array, qd: Array, loads: Array, rng: np.random.Generator) -> Samples:
        """Readings with the description's noise; of plain sensors (sign 1, no bias, outboard)."""
        noise, n = self.robot.description.noise, len(self.robot.joint_names)
        sigma = [*noise.tau, *(x for s in self.robot.sensor_names for x in noise.sensors[s])]
        loads = loads + rng.standard_normal(loads.shape) * np.array(sigma)
        qd = qd + rng.standard_normal(qd.shape) * np.array(noise.qd)
        measured = [j.measured for j in self.robot.description.joints]
        tau = np.where(measured, loads[:, :n], np.nan)
        wrench = np.ascontiguousarray(loads[:, n:]).reshape(len(q), -1, 6)
        return Samples(self.time[: len(q)], q, qd, tau, wrench)


def generator(*seed: int) -> np.random.Generator:
    """A quick source of chance."""
    return np.random.Generator(np.random.SFC64(np.random.SeedSequence(seed)))


def _lagrange(at: Array) -> Array:
    """Weights (len(at), len(POINTS)) of the values at POINTS for positions `at`, 0 to 1."""
    others = [np.delete(POINTS, k) for k in range(len(POINTS))]
    return np.stack(
        [np.prod((at[:, None] - o) / (POINTS[k] - o), axis=1) for k, o in enumerate(others)], axis=1
    )
