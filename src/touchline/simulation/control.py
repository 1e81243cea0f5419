# SPDX-License-Identifier: Apache-2.0
"""Controllers of the simulated robot. They know the plant's own dynamics, but no contact."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.simulation.plant import Plant, steady_share


class Setpoint(NamedTuple):  # made at each step of the physics: a dataclass takes longer
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
        rate: at which torques are asked for [Hz]; each is held until the next. Where a stretched
            arm has too little inertia for dampers that are held, spring and damper are softer.
            None: with each step of the physics, as they are.
    """

    trajectory: Trajectory
    stiffness: Array
    damping: Array
    rate: float | None = None

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N]."""
        goal = self.trajectory(plant.time)
        spring = self.stiffness * (goal.q - plant.q) + self.damping * (goal.qd - plant.qd)
        if self.rate is not None:
            spring *= steady_share(plant.inertia(), self.damping, self.rate)
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
    velocity, acceleration = a * w, -a * w**2

    def at(time: float) -> Setpoint:
        angle = w * time + p
        s = np.sin(angle)
        return Setpoint(c + a * s, velocity * np.cos(angle), acceleration * s)

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
