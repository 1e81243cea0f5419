# SPDX-License-Identifier: Apache-2.0
"""Simulated logs with all that a peer may ask for: truth, touched links, accelerations."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from touchline.arrays import Array, Index
from touchline.model.mechanism import Mechanism
from touchline.model.robot import Robot
from touchline.observer.dynamics import posture
from touchline.observer.samples import Samples
from touchline.simulation.contacts import ScriptedContact, ScriptedForces
from touchline.simulation.control import Trajectory
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.readings import Readings
from touchline.simulation.scene import impedance
from touchline.simulation.sensing import sense
from touchline.simulation.setup import read_setup
from touchline.simulation.simulator import Rates, run
from touchline.simulation.truth import Truth

PHYSICS = 4000.0  # Hz


@dataclass(frozen=True)
class Log:
    """A log of a robot, as its sensors report it, and what only a simulator knows.

    Attributes:
        robot: as the estimators believe it to be.
        samples: what is logged.
        acceleration: exact (N, n) [rad/s2].
        truth: true wrench (N, m, 6) on each segment, world axes, about the world's origin.
        touched: by segment, the link that is touched; segments that nothing touches are missing.
    """

    robot: Robot
    samples: Samples
    acceleration: Array
    truth: Array
    touched: Mapping[str, str]

    @property
    def time(self) -> Array:
        """(N,) [s]."""
        return self.samples.time

    def signals(self) -> tuple[Array, Array, Array, Array, Array]:
        """What an observer gets: time, q, qd, tau, wrench."""
        s = self.samples
        return s.time, s.q, s.qd, s.tau, s.wrench

    @cached_property
    def origins(self) -> Array:
        """(N, m, 3) where the sensor is that each segment begins at, world [m]."""
        placed = posture(self.robot, self.samples.q)
        names = self.robot.segment_names
        nodes = {node.sensor: i for i, node in enumerate(self.robot.nodes) if node.sensor}
        return np.stack([placed.origin[nodes[name]] for name in names], axis=1)


@dataclass(frozen=True)
class Recording:
    """Ideal readings at the rate of the physics, from which logs are made.

    Attributes:
        robot: that was simulated.
        readings: of ideal sensors, every step of the physics.
        truth: of the contacts.
        touched: see `Log`.
    """

    robot: Robot
    readings: Readings
    truth: Truth
    touched: Mapping[str, str]

    def log(
        self,
        noise: SensorNoise | None,
        rng: np.random.Generator,
        rows: Index | None = None,
    ) -> Log:
        """What sensors log.

        Args:
            noise: of the sensors; None: ideal ones.
            rng: draws the noise.
            rows: of the recording that are logged; default: 1000 per second.
        """
        rows = np.arange(0, len(self.readings.time), 4) if rows is None else rows
        ideal = _picked(self.readings, rows)
        acceleration = ideal.acceleration
        assert acceleration is not None  # recorded by `record`
        samples = sense(self.robot, ideal, noise, rng)
        wrench = segment_wrench(self.robot, self.truth)[rows]
        return Log(self.robot, samples, acceleration, wrench, self.touched)


def record(
    robot: Robot,
    trajectory: Trajectory,
    contacts: Sequence[ScriptedContact],
    seconds: float,
    mechanism: Mechanism | None = None,
) -> Recording:
    """Simulates the robot under control that tracks a trajectory.

    Args:
        robot: as the estimators believe it to be.
        trajectory: that is followed.
        contacts: scripted ones.
        seconds: duration.
        mechanism: what the robot really is; default: what is believed.
    """
    plant = Plant(robot, PHYSICS, mechanism)
    goal = trajectory(-1.0 / PHYSICS)
    plant.reset(goal.q, goal.qd, -1.0 / PHYSICS)
    controller = impedance(read_setup(robot), trajectory)
    forces = [ScriptedForces(contacts)]
    readings, truth = run(plant, controller, forces, seconds, Rates(PHYSICS))
    touched = {robot.body_of(contact.link).segment: contact.link for contact in contacts}
    return Recording(robot, readings, truth, touched)


def segment_wrench(robot: Robot, truth: Truth) -> Array:
    """True wrench (N, m, 6) on each segment at the samples, world axes, about the origin."""
    segment_of = {link: body.segment for body in robot.bodies for link in body.links}
    moment = truth.moment + np.cross(np.nan_to_num(truth.point), truth.force)
    wrench = np.concatenate([truth.force, moment], axis=-1)
    out = np.zeros((len(wrench), len(robot.segment_names), 6))
    for s, segment in enumerate(robot.segment_names):
        own = [i for i, link in enumerate(truth.links) if segment_of.get(link) == segment]
        out[:, s] = np.einsum("nc,ncw->nw", np.isin(truth.link, own), wrench)
    return out


def _picked(readings: Readings, rows: Index) -> Readings:
    names = ("time", "q", "qd", "link_torque", "motor_torque", "wrench", "acceleration")
    return replace(readings, **{name: getattr(readings, name)[rows] for name in names})
