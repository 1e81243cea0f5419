# SPDX-License-Identifier: Apache-2.0
"""Ways to feel contacts, side by side: each takes the samples of the live arm, part by part."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from touchline.arrays import Array
from touchline.detector.detector import Detector
from touchline.detector.thresholds import make_thresholds
from touchline.errors import InputError
from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.model.description import Friction
from touchline.model.robot import Robot
from touchline.observer.classical import ClassicalObserver
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact
from touchline.simulation.truth import filter_truth

LEVELS = ("contact", "collision")
THINNED = 5  # of so many samples the classical way takes one
WINDOW = 20  # thinned samples: ten time constants of its filter
PAUSE = 0.1  # s between two of its answers
NOISIER = 2.0  # its wrenches than those for which the thresholds are made


@dataclass(frozen=True)
class Felt:
    """What a method says after N samples; m segments of `segments`.

    Attributes:
        segments: names.
        time: (N,) [s].
        levels: (N, m) 0, 1 contact, 2 collision.
        wrench: (N, m, 6) on each segment, world axes, about the world origin; NaN if not known.
        tau_ext: (n,) external joint torques at the last sample [Nm]; NaN if not known.
        contacts: at the last sample.
        health: bits of the last sample.
    """

    segments: tuple[str, ...]
    time: Array
    levels: Array
    wrench: Array
    tau_ext: Array
    contacts: list[Contact]
    health: int = 0


class Method(Protocol):
    """Feels contacts."""

    def take(self, samples: Samples) -> Felt:
        """What it makes of the next samples."""
        ...


class Observed:
    """The extended observer with detection and localization, as `touchline analyze` uses it."""

    def __init__(self, robot: Robot, skin: Skin, method: str) -> None:
        self._robot = robot
        self._pipeline = Pipeline(robot, method=method, skin=skin)

    def take(self, samples: Samples) -> Felt:
        """What it makes of the next samples."""
        s = samples
        estimate, detection = self._pipeline.run(
            s.time[:-1], s.q[:-1], s.qd[:-1], s.tau[:-1], s.wrench[:-1]
        )
        last = self._pipeline.update(s.time[-1], s.q[-1], s.qd[-1], s.tau[-1], s.wrench[-1])
        levels = np.vstack([detection.levels, last.detection.levels])
        wrench = np.vstack([estimate.segment_wrench, last.estimate.segment_wrench[None]])
        return Felt(
            self._robot.segment_names,
            s.time,
            levels,
            wrench,
            last.estimate.tau_ext,
            last.contacts,
            int(last.health),
        )


class JointsOnly:
    """The same without the force-torque sensors: every joint's torque is all there is.

    Args:
        robot: with a torque signal for every joint; its force-torque sensors are taken away.
    """

    def __init__(self, robot: Robot) -> None:
        self.robot = Robot(replace(robot.description, sensors=()), robot.mechanism)
        self._detector = Detector(Observer(self.robot))
        self._localizer = Localizer(self._detector.observer, self._detector.thresholds)

    def take(self, samples: Samples) -> Felt:
        """What it makes of the next samples."""
        s = samples
        nothing = np.empty((len(s.time), 0, 6))
        estimate, detection = self._detector.run(s.time, s.q, s.qd, s.tau, nothing)
        contacts = []
        if detection.levels[-1, 0]:
            last = self._detector.observer.estimate(estimate.rows[-1])
            answer = self._localizer.locate("root", s.q[-1], last, qd=s.qd[-1])
            level = LEVELS[int(detection.levels[-1, 0]) - 1]
            contacts.append(
                Contact(
                    "root",
                    0,
                    level,
                    answer.status,
                    None,
                    answer.link,
                    answer.body,
                    answer.body_probability,
                    answer.position,
                    answer.force,
                    answer.covariance,
                    answer.candidates,
                    decided=True,  # by its threshold; onsets are not looked at
                )
            )
        return Felt(
            self.robot.segment_names,
            s.time,
            detection.levels,
            estimate.segment_wrench,
            estimate.tau_ext[-1],
            contacts,
            int(estimate.health[-1]),
        )


class Classical:
    """Accelerations from the joint residual, then Newton-Euler; the first entry of the line.

    It is written for recordings, in numpy, so it takes every fifth sample and answers ten times a
    second; in between the last answer stands.

    Args:
        robot: with a torque signal for every joint.
        skin: its surfaces.
    """

    def __init__(self, robot: Robot, skin: Skin) -> None:
        self._robot, self._skin = robot, skin
        self._observer = ClassicalObserver(robot)
        self._bandwidth = float(robot.description.bandwidth_joints[0])
        rows = make_thresholds(robot, 1e-3).rows
        m = len(robot.segment_names)
        self._limits = np.full((m, 6), np.inf)
        for row in rows:
            if row.component >= 0:
                self._limits[row.segment, row.component] = NOISIER * row.contact
        self._window: deque[tuple] = deque(maxlen=WINDOW)
        self._count, self._next = 0, -np.inf
        self._wrench, self._levels = np.full((m, 6), np.nan), np.zeros(m)
        self._tau_ext = np.full(len(robot.joint_names), np.nan)
        self._contacts: list[Contact] = []

    def take(self, samples: Samples) -> Felt:
        """What it makes of the next samples."""
        for row in range(-self._count % THINNED, len(samples.time), THINNED):
            one = (samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
            self._window.append(tuple(signal[row] for signal in one))
        self._count += len(samples.time)
        if len(self._window) == WINDOW and samples.time[-1] >= self._next:
            self._next = float(samples.time[-1]) + PAUSE
            self._answer()
        n = len(samples.time)
        return Felt(
            self._robot.segment_names,
            samples.time,
            np.tile(self._levels, (n, 1)),
            np.tile(self._wrench, (n, 1, 1)),
            self._tau_ext,
            self._contacts,
        )

    def _answer(self) -> None:
        signals = [np.array(signal) for signal in zip(*self._window, strict=True)]
        wrench = np.full((WINDOW, len(self._limits), 6), np.nan)
        self._tau_ext = np.full(signals[1].shape[1], np.nan)
        try:
            estimate = self._observer.run(*signals)
            wrench, self._tau_ext = estimate.segment_wrench, estimate.tau_ext[-1]
        except InputError:  # a torque that is not a number: it has no answer
            pass
        self._wrench = filter_truth(wrench, signals[0], self._bandwidth)[-1]
        self._levels = (np.abs(self._wrench) > self._limits).any(axis=1).astype(float)
        q = signals[1][-1]
        self._contacts = [self._contact(g, q) for g in np.flatnonzero(self._levels).tolist()]

    def _contact(self, g: int, q: Array) -> Contact:
        segment, wrench = self._robot.segment_names[g], self._wrench[g]
        force, moment = wrench[:3], wrench[3:]
        origin = np.cross(force, moment) / (force @ force)
        for crossing in self._skin.crossings(q, origin, force, segment):
            if crossing.entry:
                return Contact(
                    segment,
                    0,
                    LEVELS[0],
                    "located",
                    wrench,
                    crossing.link,
                    self._robot.body_of(crossing.link).name,
                    1.0,
                    crossing.position,
                    force,
                    decided=True,
                )
        return Contact(segment, 0, LEVELS[0], "wrench_only", wrench, force=force, decided=True)


METHODS: dict[str, Callable[[Robot, Robot, Skin], Method]] = {
    "segment": lambda own, full, skin: Observed(own, skin, "segment"),
    "paper": lambda own, full, skin: Observed(own, skin, "paper"),
    "classical": lambda own, full, skin: Classical(full, skin),
    "joint torques only": lambda own, full, skin: JointsOnly(full),
}


def methods_of(robot: Robot) -> tuple[str, ...]:
    """The methods that suit a robot: the classical one compares with force-torque sensors."""
    six_axis = [sensor for sensor in robot.description.sensors if len(sensor.axes) == 6]
    return tuple(name for name in METHODS if name != "classical" or six_axis)


def fully_measured(robot: Robot) -> Robot:
    """The same robot with a torque sensor in every joint."""
    joints = tuple(
        replace(joint, torque="sensor", sources=(), rotor_inertia=0.0, friction=Friction())
        for joint in robot.description.joints
    )
    return Robot(replace(robot.description, joints=joints), robot.mechanism)
