# SPDX-License-Identifier: Apache-2.0
"""Runs a plant with its controller and contacts, and records ideal readings and the truth.

Inputs are held over each physics step, so readings jump where a step begins. A recorded reading is
the mean of its values just before and just after that jump. Then the trapezoid rule over the
samples is right to second order, and nothing is late by half a step.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from touchline.arrays import Array
from touchline.simulation.contacts import Touch
from touchline.simulation.control import Controller
from touchline.simulation.plant import Plant
from touchline.simulation.readings import Readings
from touchline.simulation.truth import Truth, TruthRecorder


class Contacts(Protocol):
    """Whatever touches the robot; the number of its slots never changes."""

    physical: bool  # forces follow from the physics and not from a script

    def __len__(self) -> int: ...

    def apply(self, plant: Plant) -> bool:
        """Sets the inputs of the plant's present time; returns whether any changed."""
        ...

    def touches(self, plant: Plant) -> list[Touch]:
        """What acts at the plant's present state and inputs, one per slot."""
        ...


@dataclass(frozen=True)
class Rates:
    """Rates [Hz] that divide that of the physics; `control` None: the physics' own."""

    log: float = 1000.0
    control: float | None = None

    def strides(self, physics: float) -> tuple[int, int]:
        """Physics steps per sample of the log, and per step of the controller.

        Raises:
            ValueError: a rate does not divide the physics'.
        """
        control = self.control or physics
        strides = []
        for name, rate in (("log", self.log), ("control", control)):
            stride = round(physics / rate) if rate > 0 else 0
            if stride < 1 or abs(stride * rate - physics) > 1e-6 * physics:
                raise ValueError(f"{name} rate {rate:g} Hz does not divide physics' {physics:g} Hz")
            strides.append(stride)
        return strides[0], strides[1]


def run(
    plant: Plant,
    controller: Controller,
    contacts: Sequence[Contacts] = (),
    seconds: float = 1.0,
    rates: Rates | None = None,
    sampled: Callable[[Readings, int], None] | None = None,
) -> tuple[Readings, Truth]:
    """Simulates from the plant's present state on.

    Args:
        plant: after `reset`; the log begins one of its periods later.
        controller: of the motors.
        contacts: scripted forces and colliding bodies; their slots follow each other.
        seconds: from the first sample to the last.
        rates: of log and controller; default: 1 kHz, and the physics' own.
        sampled: called after each sample of the log with the readings and its row.

    Returns:
        Ideal readings and the truth, `seconds * log rate + 1` samples.
    """
    simulation = Simulation(plant, controller, contacts, rates, sampled)
    log_stride = simulation.strides[0]
    return simulation.advance(1 + round(seconds * plant.rate / log_stride))


class Simulation:
    """A simulation that goes on from one part of its log to the next.

    Arguments as for `run`.
    """

    def __init__(
        self,
        plant: Plant,
        controller: Controller,
        contacts: Sequence[Contacts] = (),
        rates: Rates | None = None,
        sampled: Callable[[Readings, int], None] | None = None,
    ) -> None:
        self.plant, self.controller = plant, controller
        self.strides = (rates or Rates()).strides(plant.rate)
        self._sampled = sampled
        self._stepper = _Stepper(plant, contacts, self.strides[0])
        self._command = np.zeros(len(plant.robot.joint_names))
        self._step = 0

    def advance(self, rows: int) -> tuple[Readings, Truth]:
        """Ideal readings and the truth of the next `rows` samples of the log."""
        self._stepper.make_room(rows)
        if self._step == 0:
            self._visit(-1)
        for row in range(rows):
            for left in range(self.strides[0] - 1, -1, -1):
                self.plant.integrate()
                self._step += 1
                self._visit(-1 if left else row)
        return self._stepper.readings, self._stepper.truth.truth

    def _visit(self, row: int) -> None:
        """A state: the end of a physics step and the beginning of the next."""
        self.plant.evaluate()
        if self._step:
            self._stepper.end_step(row)
        if self._step % self.strides[1] == 0:
            self._command = self.controller.torque(self.plant)
        self._stepper.begin_step(row, self._command)
        if self._sampled is not None and row >= 0:
            self._sampled(self._stepper.readings, row)


class _Stepper:
    """One physics step after the other, with what is recorded at its two ends."""

    def __init__(self, plant: Plant, contacts: Sequence[Contacts], stride: int) -> None:
        self._plant, self._contacts = plant, contacts
        self._physical = any(contact.physical for contact in contacts)
        slots = sum(len(contact) for contact in contacts)
        self.truth = TruthRecorder(tuple(plant.bodies), slots, stride)
        self.make_room(0)

    def make_room(self, rows: int) -> None:
        """For the next samples of the log."""
        self.readings = Readings.empty(self._plant, rows)
        self.truth.make_room(rows)

    def _touches(self) -> list[Touch]:
        if len(self._contacts) == 1:
            return self._contacts[0].touches(self._plant)
        return [touch for contact in self._contacts for touch in contact.touches(self._plant)]

    def end_step(self, row: int) -> None:
        """At the new state, with the inputs that led to it still set; `row` < 0: not logged."""
        if row >= 0 or self._physical:
            self._plant.accelerate()
        self._ending = self._touches()
        self.truth.add(self._ending)
        if row >= 0:
            self.truth.close(row)
            self._before = self._plant.read()

    def begin_step(self, row: int, command: Array) -> None:
        """At the same state, with the new inputs and accelerations; `row` < 0: not logged."""
        plant = self._plant
        changed = plant.command(command)
        for contact in self._contacts:
            changed = contact.apply(plant) or changed
        if changed or row < 0:
            plant.accelerate()
        beginning = self._touches()
        self.truth.add(beginning)
        if row >= 0:
            after = plant.read() if changed else self._before
            self.readings.put(row, plant, self._before, after)
            self.truth.put(row, self._ending, beginning)
