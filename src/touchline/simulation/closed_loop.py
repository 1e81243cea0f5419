# SPDX-License-Identifier: Apache-2.0
"""The loop from sensors to motors: what the simulated robot feels decides what it does.

At each sample the sensors are read, with noise; the pipeline says what touches; the reactor answers
with torques, which the motors take on at the next sample, one period later.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline, Result
from touchline.reaction.reactor import Command, Reactor
from touchline.reaction.state import State
from touchline.simulation.control import Controller
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.readings import Readings
from touchline.simulation.sensing import sense


class LiveSensors:
    """Turns ideal readings into what the robot would log, one sample at a time.

    Noise and offsets are drawn ahead; delays of the description are not simulated.

    Args:
        plant: whose sensors.
        count: of samples.
        rate: of the samples [Hz].
        noise: None for ideal sensors.
        rng: draws the noise.
    """

    def __init__(
        self,
        plant: Plant,
        count: int,
        rate: float,
        noise: SensorNoise | None,
        rng: np.random.Generator,
    ) -> None:
        self._robot = plant.robot
        nothing = Readings.empty(plant, count)
        for array in vars(nothing).values():
            if array is not None:
                array[:] = 0.0
        nothing.time[:] = np.arange(count) / rate
        self._noise = noise.disturb(plant.robot, nothing, rng) if noise else nothing

    def sample(self, readings: Readings, row: int) -> tuple[float, Array, Array, Array, Array]:
        """Time, q, qd, tau and wrench of one row, as `Pipeline.update` takes them."""
        parts: dict[str, Any] = {}
        for name, array in vars(readings).items():
            parts[name] = None if array is None else array[row : row + 1]
        for name in ("qd", "link_torque", "motor_torque", "wrench"):
            parts[name] = parts[name] + getattr(self._noise, name)[row]
        s = sense(self._robot, replace(readings, **parts))
        return float(s.time[0]), s.q[0], s.qd[0], s.tau[0], s.wrench[0]


@dataclass(frozen=True)
class Step:
    """What one sample of the loop brought."""

    time: float
    result: Result
    command: Command


class ReactingController:
    """The robot's own controller until something touches; then the reactor's command.

    Args:
        robot: whose pipeline and reactor these are.
        own: the robot's own controller.
        pipeline: fresh.
        reactor: fresh.
        sensors: of the plant.
    """

    def __init__(
        self,
        robot: Robot,
        own: Controller,
        pipeline: Pipeline,
        reactor: Reactor,
        sensors: LiveSensors,
    ) -> None:
        self._robot, self._own = robot, own
        self._pipeline, self._reactor, self._sensors = pipeline, reactor, sensors
        self._sample: tuple[float, Array, Array] | None = None
        self._result: Result | None = None
        self.steps: list[Step] = []

    def torque(self, plant: Plant) -> Array:
        """Motor torques (n,) [Nm or N] that follow from the sample before."""
        own = self._own.torque(plant) - plant.friction_torque()
        if self._sample is None or self._result is None:
            limits = [self._robot.mechanism.joints[name].effort for name in self._robot.joint_names]
            return np.clip(own, -np.array(limits), np.array(limits)) + plant.friction_torque()
        time, q, qd = self._sample
        state = State(self._robot, time, q, qd, own, self._result.estimate.tau_ext)
        command = self._reactor.update(self._result.contacts, state)
        self.steps.append(Step(time, self._result, command))
        return command.torque + plant.friction_torque()

    def sampled(self, readings: Readings, row: int) -> None:
        """Takes a sample; see `simulator.run`."""
        sample = self._sensors.sample(readings, row)
        self._result = self._pipeline.update(*sample)
        self._sample = sample[:3]
