# SPDX-License-Identifier: Apache-2.0
"""Runs a plant with its controller and contacts, and records ideal readings and the truth.

Inputs are held over each physics step, so readings jump where a step begins. A recorded reading is
the mean of its values just before and just after that jump: then the trapezoid rule over the
samples is right to second order, and nothing is late by half a step.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from touchline.simulation.contacts import Touch, cross
from touchline.simulation.control import Controller
from touchline.simulation.plant import Plant, Reading
from touchline.simulation.truth import Truth

Array = NDArray[np.float64]


class Contacts(Protocol):
    """Whatever touches the robot; the number of its slots never changes."""

    physical: bool  # forces follow from the physics and not from a script

    def __len__(self) -> int: ...

    def apply(self, plant: Plant) -> None:
        """Sets the inputs of the plant's present time."""
        ...

    def touches(self, plant: Plant) -> list[Touch]:
        """What acts at the plant's present state and inputs, one per slot."""
        ...


@dataclass(frozen=True)
class Readings:
    """N samples of ideal sensors, and what is needed to log them in any convention.

    Attributes:
        time: (N,) [s].
        q, qd: (N, n) [rad or m].
        link_torque, motor_torque, friction: (N, n) [Nm or N]; see `Reading`.
        gravity_torque, motion_torque: (N, n) what gravity, and what gravity and motion take.
        wrench: (N, k, 6) on the outboard body, sensor frame [N, Nm].
        weight: (N, k, 6) gravity's wrench on what the sensor carries, sensor frame.
        R_world_sensor: (N, k, 3, 3).
        R_world_log: (N, k, 3, 3) axes in which the description wants the wrench.
    """

    time: Array
    q: Array
    qd: Array
    link_torque: Array
    motor_torque: Array
    gravity_torque: Array
    motion_torque: Array
    wrench: Array
    weight: Array
    R_world_sensor: Array
    R_world_log: Array


@dataclass(frozen=True)
class Rates:
    """Rates [Hz]; `physics` is that of the plant, and the others divide it.

    Raises:
        ValueError: one does not.
    """

    log: float = 1000.0
    control: float | None = None

    def strides(self, physics: float) -> tuple[int, int]:
        """Physics steps per sample of the log, and per step of the controller."""
        control = self.control or physics
        strides = []
        for name, rate in (("log", self.log), ("control", control)):
            stride = round(physics / rate)
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
) -> tuple[Readings, Truth]:
    """Simulates from the plant's present state on.

    Args:
        plant: after `reset`; the log begins one of its periods later.
        controller: of the motors.
        contacts: scripted forces and colliding bodies; their slots follow each other.
        seconds: from the first sample to the last.
        rates: of log and controller; default: 1 kHz, and the physics' own.

    Returns:
        Ideal readings and the truth, `seconds * log rate + 1` samples.
    """
    log_stride, control_stride = (rates or Rates()).strides(plant.rate)
    recorder = _Recorder(plant, contacts, log_stride)
    steps = (1 + round(seconds * plant.rate / log_stride)) * log_stride
    command = np.zeros(len(plant.robot.joint_names))
    for step in range(steps + 1):
        plant.evaluate()
        logged = step > 0 and step % log_stride == 0
        if step:
            recorder.end_step(logged)
        if step % control_stride == 0:
            command = controller.torque(plant)
        plant.command(command)
        for contact in contacts:
            contact.apply(plant)
        plant.accelerate()
        recorder.begin_step(logged)
        if step < steps:
            plant.integrate()
    return recorder.readings(), recorder.truth()


class _Recorder:
    """Collects readings at the log's instants, and contact wrenches over the time between."""

    def __init__(self, plant: Plant, contacts: Sequence[Contacts], stride: int) -> None:
        self._plant, self._contacts, self._stride = plant, contacts, stride
        self._physical = any(contact.physical for contact in contacts)
        self._slots = sum(len(contact) for contact in contacts)
        self._index = {name: i for i, name in enumerate(plant.bodies)}
        description = plant.robot.description
        self._wanted = {joint.compensated for joint in description.joints}
        self._weighed = any(s.compensated == "gravity" for s in description.sensors)
        self._turned = any(s.frame != "sensor" for s in description.sensors)
        self._rows: list[tuple[Array, ...]] = []
        self._truth: list[tuple[Array, ...]] = []
        self._before: tuple[Reading, list[Touch]]
        self._begin = np.zeros((self._slots, 6))
        self._clear()

    def _clear(self) -> None:
        self._sum = np.zeros((self._slots, 6))
        self._touched = np.full(self._slots, -1)

    def _touches(self) -> list[Touch]:
        return [touch for contact in self._contacts for touch in contact.touches(self._plant)]

    def end_step(self, logged: bool) -> None:
        """At the new state, with the inputs that led to it still set."""
        if logged or self._physical:
            self._plant.accelerate()
        if self._slots:
            touches = self._touches()
            self._add(touches, np.array([_wrench(touch) for touch in touches]))
        if logged:
            self._before = self._plant.read(), self._touches()

    def _add(self, touches: list[Touch], end: Array) -> None:
        self._sum += (self._begin + end) / (2 * self._stride)
        for slot, touch in enumerate(touches):
            if touch.active:
                self._touched[slot] = self._index[touch.link]

    def begin_step(self, logged: bool) -> None:
        """At the same state, with the new inputs and accelerations."""
        touches = self._touches()
        self._begin = np.array([_wrench(touch) for touch in touches]).reshape(-1, 6)
        if logged:
            after = self._plant.read(), touches
            self._record(*zip(self._before, after, strict=True))
            self._clear()

    def _record(
        self, readings: tuple[Reading, Reading], touches: tuple[list[Touch], list[Touch]]
    ) -> None:
        plant, (a, b) = self._plant, readings
        row = (
            np.array(round(plant.time * plant.rate) / plant.rate),
            plant.q,
            plant.qd,
            (a.link_torque + b.link_torque) / 2,
            (a.motor_torque + b.motor_torque) / 2,
            *self._compensations(),
            (a.wrench + b.wrench) / 2,
            *self._conventions(),
        )
        self._rows.append(row)
        slots = [self._slot(*pair) for pair in zip(*touches, strict=True)]
        link, point, force, moment = ([s[i] for s in slots] for i in range(4))
        c = self._slots
        self._truth.append(
            (
                np.array(link, dtype=int),
                np.reshape(point, (c, 3)),
                np.reshape(force, (c, 3)),
                np.reshape(moment, (c, 3)),
                self._sum,
                self._touched,
            )
        )

    def _slot(self, a: Touch, b: Touch) -> tuple[int, Array, Array, Array]:
        """One contact at a sample, the mean of before and after."""
        shown = b if b.active or not a.active else a
        link = self._index[shown.link] if a.active or b.active else -1
        point = shown.point if link >= 0 else np.full(3, np.nan)
        return link, point, (a.force + b.force) / 2, (a.moment + b.moment) / 2

    def _compensations(self) -> tuple[Array, Array]:
        """Gravity's and the motion's torques, where a joint's driver takes them out."""
        plant, nothing = self._plant, np.zeros(len(self._plant.robot.joint_names))
        return (
            plant.gravity_torque() if "gravity" in self._wanted else nothing,
            plant.motion_torque() if "model" in self._wanted else nothing,
        )

    def _conventions(self) -> tuple[Array, Array, Array]:
        """Weights and axes, where a sensor's log needs them."""
        plant, k = self._plant, len(self._plant.robot.sensor_names)
        weights = plant.sensor_weights() if self._weighed else np.zeros((k, 6))
        rotations = plant.sensor_rotations().copy()
        return weights, rotations, _log_rotations(plant, rotations) if self._turned else rotations

    def readings(self) -> Readings:
        return Readings(*(np.array(column) for column in zip(*self._rows, strict=True)))

    def truth(self) -> Truth:
        link, point, force, moment, mean, link_mean = (
            np.array(column) for column in zip(*self._truth, strict=True)
        )
        return Truth(tuple(self._index), link, point, force, moment, mean, link_mean)


def _wrench(touch: Touch) -> Array:
    """About the world's origin (6,)."""
    if not touch.active:
        return np.zeros(6)
    return np.concatenate([touch.force, cross(touch.point, touch.force) + touch.moment])


def _log_rotations(plant: Plant, own: Array) -> Array:
    rotations = []
    for s, sensor in enumerate(plant.robot.description.sensors):
        if sensor.frame == "sensor":
            rotations.append(own[s])
        elif sensor.frame == "world":
            rotations.append(np.eye(3))
        else:
            rotations.append(plant.link_pose(sensor.frame)[:3, :3])
    return np.reshape(rotations, (-1, 3, 3))
