# SPDX-License-Identifier: Apache-2.0
"""Observer, detection and (later stages) localization in one object."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchline.contact.contact import Contact
from touchline.contact.detector import Detection, Detector
from touchline.contact.event import Event, EventRecorder
from touchline.estimation.observer import Estimate, Observer
from touchline.model.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Result:
    """What one sample brought.

    Attributes:
        estimate: torques and wrenches.
        contacts: one per segment that is touched.
        detection: levels per segment.
        health: health bits of the sample (`touchline.Health`).
    """

    estimate: Estimate
    contacts: list[Contact]
    detection: Detection
    health: int


class Pipeline:
    """From samples to contacts, one sample at a time or part by part of a recording.

    Args:
        robot: the robot.
        bandwidth: of the observer [rad/s]; default: the description's.
        method: of the observer, "segment" or "paper".
        period: time between samples [s], for thresholds that follow from the noise.
    """

    def __init__(
        self,
        robot: Robot,
        bandwidth: float | None = None,
        method: str = "segment",
        period: float = 1e-3,
    ) -> None:
        self.robot = robot
        self.observer = Observer(robot, bandwidth, method)
        self.detector = Detector(self.observer, period=period)
        self.recorder = EventRecorder(self.detector)

    @property
    def events(self) -> list[Event]:
        """All events so far, in the order of detection; one that lasts has `cleared` None."""
        return self.recorder.events

    def update(
        self,
        time: float,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> Result:
        """Takes one sample, as `Observer.update`; a bad one is reported in `health`."""
        estimate, detection = self.detector.update(time, q, qd, tau, wrench)
        if detection.levels.any() or self.recorder.open_events():
            many = Detection(detection.levels[None], detection.normalized[None])
            rows = self.observer.estimate(estimate.rows[None])
            self.recorder.add(np.array([time]), np.asarray(q, float)[None], rows, many)
        return Result(estimate, self._contacts(estimate), detection, estimate.health)

    def run(
        self,
        time: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> tuple[Estimate, Detection]:
        """Takes a recording or the next part of one; `events` tells what was found."""
        estimate, detection = self.detector.run(time, q, qd, tau, wrench)
        stamps = np.asarray(time, dtype=float)
        self.recorder.add(stamps, np.asarray(q, dtype=float), estimate, detection)
        return estimate, detection

    def _contacts(self, estimate: Estimate) -> list[Contact]:
        contacts = []
        for g, event in self.recorder.open_events().items():
            wrench = None if event.segment == "root" else estimate.segment_wrench[g]
            force = None if wrench is None else wrench[:3]
            contacts.append(
                Contact(event.segment, event.id, event.level, wrench=wrench, force=force)
            )
        return contacts
