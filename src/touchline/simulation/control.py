# SPDX-License-Identifier: Apache-2.0
"""Controllers of the simulated robot. They know the plant's own dynamics, but no contact."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.simulation.plant import Plant


@dataclass(frozen=True)
class Setpoint:
    """Desired positions, velocities and accelerations, (n,) each [rad, rad/s, rad/s2]."""

    q: Array
    qd: Array
    qdd: Array


Trajectory = Callable[[float], Setpoint]


class Controller(Protocol):
    """Computes motor torques (n,) from the state that the plant has evaluated."""

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N] for the plant's present state."""
        ...


@dataclass(frozen=True)
class GravityCompensation:
    """Carries the robot's weight and brakes it a little: it can be led by hand.

    Attributes:
        damping: (n,) or a number [Nm s/rad].
    """

    damping: Array | float = 0.0

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N]."""
        return plant.bias_torque() - self.damping * plant.qd + plant.friction_torque()


@dataclass(frozen=True)
class JointImpedance:
    """A spring and a damper in each joint about a trajectory, weight and inertia fed forward.

    Attributes:
        trajectory: setpoint by time [s].
        stiffness: (n,) [Nm/rad].
        damping: (n,) [Nm s/rad].
    """

    trajectory: Trajectory
    stiffness: Array
    damping: Array

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N]."""
        goal = self.trajectory(plant.time)
        spring = self.stiffness * (goal.q - plant.q) + self.damping * (goal.qd - plant.qd)
        forward = plant.inertia_times(goal.qdd) + plant.bias_torque() + plant.friction_torque()
        return forward + spring


@dataclass(frozen=True)
class ComputedTorque:
    """Tracks a trajectory with the same error dynamics in every joint of any robot.

    Attributes:
        trajectory: setpoint by time [s].
        frequency: of the critically damped error dynamics [rad/s].
    """

    trajectory: Trajectory
    frequency: float = 60.0

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N]."""
        goal, w = self.trajectory(plant.time), self.frequency
        wanted = goal.qdd + 2 * w * (goal.qd - plant.qd) + w**2 * (goal.q - plant.q)
        return plant.inertia_times(wanted) + plant.bias_torque() + plant.friction_torque()


def hold(q: ArrayLike) -> Trajectory:
    """Stands still at `q` (n,)."""
    q = np.asarray(q, float)
    still = Setpoint(q, np.zeros_like(q), np.zeros_like(q))
    return lambda time: still


def sinusoids(
    center: ArrayLike, amplitude: ArrayLike, frequency: ArrayLike, phase: ArrayLike
) -> Trajectory:
    """`center + amplitude sin(frequency t + phase)`, all (n,) [rad, rad/s]."""
    c, a, w, p = (np.asarray(x, float) for x in (center, amplitude, frequency, phase))

    def at(time: float) -> Setpoint:
        s, co = np.sin(w * time + p), np.cos(w * time + p)
        return Setpoint(c + a * s, a * w * co, -a * w**2 * s)

    return at


def waypoints(points: Sequence[ArrayLike], times: Sequence[float]) -> Trajectory:
    """Passes `points` (m, n) at `times` (m,) [s], at rest at each, by polynomials of degree five.

    Before the first and after the last time it stands still.

    Raises:
        ValueError: the times do not increase, or are not one per point.
    """
    q, t = np.asarray(points, float), np.asarray(times, float)
    if q.ndim != 2 or len(q) != len(t) or np.any(np.diff(t) <= 0):
        raise ValueError("waypoints need one increasing time per point")

    def at(time: float) -> Setpoint:
        i = int(np.clip(np.searchsorted(t, time) - 1, 0, max(len(t) - 2, 0)))
        if len(t) == 1:
            return Setpoint(q[0], np.zeros_like(q[0]), np.zeros_like(q[0]))
        span, way = t[i + 1] - t[i], q[i + 1] - q[i]
        x = min(max((time - t[i]) / span, 0.0), 1.0)
        s = x**3 * (10 - 15 * x + 6 * x**2)
        ds = 30 * x**2 * (1 - x) ** 2 / span
        dds = 60 * x * (1 - x) * (1 - 2 * x) / span**2
        return Setpoint(q[i] + s * way, ds * way, dds * way)

    return at


class JointSprings:
    """Holds a pose with springs and dampers that are part of the physics, weight fed forward.

    Args:
        q: (n,) the pose [rad or m].
        stiffness, damping: (n,) see `Plant.hold`.
    """

    def __init__(
        self, q: Array, stiffness: Array | None = None, damping: Array | None = None
    ) -> None:
        self._q, self._stiffness, self._damping = q, stiffness, damping
        self._weight: Array | None = None

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N] beside the springs'."""
        if self._weight is None:
            self._weight = plant.gravity_torque()
            plant.hold(self._q, self._stiffness, self._damping)
            plant.evaluate()
        return self._weight
