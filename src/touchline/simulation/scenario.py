# SPDX-License-Identifier: Apache-2.0
"""Scenarios: functions that return a simulated log with its truth.

All take the robot first and share the settings of `Run`; the same seed gives the same numbers.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.model.robot import Robot
from touchline.simulation.contacts import Profile, ScriptedContact, ScriptedForces
from touchline.simulation.control import (
    ComputedTorque,
    JointImpedance,
    Trajectory,
    hold,
    sinusoids,
)
from touchline.simulation.noise import SensorNoise, perturbed
from touchline.simulation.plant import Plant
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup, read_setup
from touchline.simulation.simulator import Contacts, Rates, run
from touchline.simulation.truth import Simulated

Array = NDArray[np.float64]
Tracking = ComputedTorque | JointImpedance


@dataclass(frozen=True)
class Run:
    """Settings of every scenario.

    Attributes:
        seed: of motions, places and noise.
        rate: of the log [Hz]; divides `physics`.
        physics: rate of the physics [Hz].
        control: rate of the controller [Hz]; default: that of the physics.
        noise: of the sensors; None: ideal sensors.
        model_error: 1 sigma of the relative error of the plant's inertias.
    """

    seed: int = 0
    rate: float = 1000.0
    physics: float = 4000.0
    control: float | None = None
    noise: SensorNoise | None = None
    model_error: float = 0.0


def simulate(
    robot: Robot,
    controller: Tracking,
    contacts: Sequence[Contacts],
    seconds: float,
    settings: Run,
    **metadata: Any,
) -> Simulated:
    """Runs a scenario whose controller follows a trajectory, from that on; its log starts at 0."""
    rng = np.random.default_rng([settings.seed, 1])
    plant = make_plant(robot, settings)
    begin = -1.0 / settings.rate
    goal = controller.trajectory(begin)
    plant.reset(goal.q, goal.qd, begin)
    rates = Rates(settings.rate, settings.control)
    readings, truth = run(plant, controller, contacts, seconds, rates)
    samples = sense(robot, readings, settings.noise, rng)
    return Simulated(samples, truth, describe(robot, settings) | metadata)


def make_plant(robot: Robot, settings: Run, **options: Any) -> Plant:
    """The plant with the settings' rate and errors of the model."""
    mechanism = robot.mechanism
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
        "truth.links": list(robot.mechanism.links),
    }


def impedance(setup: Setup, trajectory: Trajectory) -> Tracking:
    """Joint impedance with the robot's gains, or computed torque where none are known."""
    if setup.stiffness is None or setup.damping is None:
        return ComputedTorque(trajectory)
    return JointImpedance(trajectory, setup.stiffness, setup.damping)


def wandering(setup: Setup, speed: float, rng: np.random.Generator) -> Trajectory:
    """Sinusoids about the home pose, the fastest joint at `speed` [rad/s] at most."""
    n = len(setup.home)
    amplitude = rng.uniform(0.4, 1.0, n) * np.clip(
        np.minimum(setup.upper - setup.home, setup.home - setup.lower), 0.05, 0.8
    )
    peak = np.minimum(rng.uniform(0.5, 1.0, n), 1.0)
    peak[rng.integers(n)] = 1.0
    velocity = np.minimum(speed * peak, 0.9 * setup.speed)
    return sinusoids(setup.home, amplitude, velocity / amplitude, rng.uniform(0, 2 * np.pi, n))


def free_motion(
    robot: Robot, seconds: float = 10.0, speed: float = 1.0, settings: Run | None = None
) -> Simulated:
    """The arm moves and nothing touches it.

    Args:
        robot: any.
        seconds: duration.
        speed: of the fastest joint [rad/s].
        settings: rates, noise, seed.
    """
    settings = settings or Run()
    setup = read_setup(robot)
    trajectory = wandering(setup, speed, np.random.default_rng(settings.seed))
    controller = ComputedTorque(trajectory)
    return simulate(robot, controller, [], seconds, settings, scenario="free_motion")


def scripted(
    robot: Robot,
    contacts: Sequence[ScriptedContact],
    seconds: float,
    speed: float = 0.0,
    settings: Run | None = None,
    start: Array | None = None,
    **metadata: Any,
) -> Simulated:
    """Forces at given points of the arm, which stands (`speed` 0) or moves [rad/s].

    Args:
        robot: any.
        contacts: one slot of the truth each.
        seconds: duration.
        speed: of the fastest joint; standing, the arm is held by joint impedance control.
        settings: rates, noise, seed.
        start: (n,) where a standing arm stands; default: home.
        metadata: kept with the log.
    """
    settings = settings or Run()
    setup = read_setup(robot)
    if speed:
        trajectory = wandering(setup, speed, np.random.default_rng(settings.seed))
        controller: Tracking = ComputedTorque(trajectory)
    else:
        trajectory = hold(setup.home if start is None else start)
        controller = impedance(setup, trajectory)
    forces = [ScriptedForces(contacts)]
    return simulate(robot, controller, forces, seconds, settings, **metadata)


__all__ = ["Profile", "Run", "ScriptedContact", "SensorNoise", "free_motion", "scripted"]
