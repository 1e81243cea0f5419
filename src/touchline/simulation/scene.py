# SPDX-License-Identifier: Apache-2.0
"""What all scenarios share: their settings, the motions, and one run from start to log."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.mechanism import Mechanism
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.simulation.control import (
    ComputedTorque,
    JointImpedance,
    Trajectory,
    sinusoids,
)
from touchline.simulation.mujoco_model import Addition
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup
from touchline.simulation.simulator import Contacts, Rates, run
from touchline.simulation.truth import Simulated

Tracking = ComputedTorque | JointImpedance


@dataclass(frozen=True)
class Run:
    """Settings of every scenario.

    Attributes:
        seed: of motions, places and noise.
        rate: of the log [Hz]; divides `physics`.
        physics: rate of the physics [Hz]; below 4 kHz joint impedance control may be unstable.
        control: rate of the controller [Hz]; default: that of the physics.
        noise: of the sensors; None: ideal sensors.
        model_error: 1 sigma of the relative error of the plant's inertias.
        arm: what moves; None: the robot as it is told.
    """

    seed: int = 0
    rate: float = 1000.0
    physics: float = 4000.0
    control: float | None = None
    noise: SensorNoise | None = None
    model_error: float = 0.0
    arm: Mechanism | None = None


def simulate(
    robot: Robot,
    controller: Tracking,
    contacts: Sequence[Contacts],
    seconds: float,
    settings: Run,
    addition: Addition | None = None,
    **metadata: Any,
) -> Simulated:
    """Runs a scenario whose controller follows a trajectory, from that on; its log starts at 0.

    Args:
        robot: any.
        controller: and its trajectory.
        contacts: their slots follow each other in the truth.
        seconds: duration.
        settings: rates, noise, seed, errors of the model.
        addition: to the plant's model; see `build_model`.
        metadata: kept with the log; JSON values.
    """
    rng = np.random.default_rng([settings.seed, 1])
    plant = make_plant(robot, settings, addition=addition)
    begin = -1.0 / settings.rate
    goal = controller.trajectory(begin)
    plant.reset(goal.q, goal.qd, begin)
    rates = Rates(settings.rate, settings.control)
    readings, truth = run(plant, controller, contacts, seconds, rates)
    samples = sense(robot, readings, settings.noise, rng)
    return Simulated(samples, truth, describe(robot, settings) | metadata)


def make_plant(robot: Robot, settings: Run, **options: Any) -> Plant:
    """The plant with the settings' rate and errors of the model."""
    mechanism = settings.arm or robot.mechanism
    if settings.model_error:
        rng = np.random.default_rng([settings.seed, 2])
        mechanism = perturbed(mechanism, settings.model_error, rng)
    return Plant(robot, settings.physics, mechanism, **options)


def describe(robot: Robot, settings: Run) -> dict[str, Any]:
    """The settings as metadata of a log."""
    return {
        "robot": robot.name,
        "seed": settings.seed,
        "rate": settings.rate,
        "physics": settings.physics,
        "noise": settings.noise is not None,
    }


def impedance(setup: Setup, trajectory: Trajectory, rate: float | None = None) -> Tracking:
    """Joint impedance with the robot's gains, or computed torque where none are known.

    `rate`: as of `JointImpedance`.
    """
    if setup.stiffness is None or setup.damping is None:
        return ComputedTorque(trajectory)
    return JointImpedance(trajectory, setup.stiffness, setup.damping, rate)


def wandering(
    setup: Setup,
    speed: float,
    rng: np.random.Generator,
    center: Array | None = None,
    reach: float = 0.8,
) -> Trajectory:
    """Sinusoids about a pose, one joint as fast as wanted and the others slower.

    Args:
        setup: limits of positions and velocities.
        speed: of the fastest joint [rad/s], within its limit.
        rng: draws amplitudes, frequencies and phases.
        center: (n,) [rad]; default: home.
        reach: largest amplitude [rad].
    """
    center = setup.home if center is None else np.asarray(center, float)
    n = len(center)
    room = np.minimum(setup.upper - center, center - setup.lower)
    amplitude = rng.uniform(0.4, 1.0, n) * np.clip(room, 0.01, reach)
    share = rng.uniform(0.5, 1.0, n)
    share[rng.integers(n)] = 1.0
    velocity = np.minimum(speed * share, 0.9 * setup.speed)
    return sinusoids(center, amplitude, velocity / amplitude, rng.uniform(0, 2 * np.pi, n))
