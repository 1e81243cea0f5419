# SPDX-License-Identifier: Apache-2.0
"""Observer, detection and localization in one object."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchline.classifier.classifier import Classifier
from touchline.classifier.zones import Zones
from touchline.detector.detector import Detection, Detector
from touchline.detector.thresholds import expect_drift, make_thresholds
from touchline.localizer.answer import ANSWER, NUMBER, SAMPLE, SEGMENT
from touchline.localizer.localizer import FRICTION, MODEL_ERROR, TORQUE_ERROR, Localizer
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.observer import Estimate, Observer
from touchline.pipeline.event_recorder import EventRecorder
from touchline.pipeline.live_contact import LiveContact, LiveSample
from touchline.pipeline.table import ContactTable
from touchline.result.contact import Contact
from touchline.result.event import Event

Array = NDArray[np.float64]

PENDING = 256  # samples of a live stream that the events may lag behind


@dataclass(frozen=True)
class Result:
    """What one sample brought.

    Attributes:
        estimate: torques and wrenches.
        contacts: at least one per segment that is touched.
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
        period: time between samples [s], for thresholds and weights that follow from the noise.
        rule: of the localizer, "likelihood" or "paper" (the first entry of the line).
        wrench_error: of gains and model, as a part of the load, and `torque_error`, for the
            localizer's weights.
        skin: the robot's surfaces, if already at hand.
        friction: coefficient of the cone in which pushes are looked for.
        model_error: 1 sigma of the relative error of the model's masses and inertias, for the
            localizer's weights where the robot is not calibrated; 0: the model is right.
    """

    def __init__(
        self,
        robot: Robot,
        bandwidth: float | None = None,
        method: str = "segment",
        period: float = 1e-3,
        rule: str = "likelihood",
        wrench_error: float = 0.0,
        torque_error: float = TORQUE_ERROR,
        skin: Skin | None = None,
        friction: float = FRICTION,
        model_error: float = MODEL_ERROR,
    ) -> None:
        self.robot = robot
        self.observer = Observer(robot, bandwidth, method)
        thresholds = expect_drift(robot, make_thresholds(robot, period), model_error)
        self.detector = Detector(self.observer, thresholds, period)
        self.localizer = Localizer(
            self.observer,
            self.detector.thresholds,
            period,
            rule=rule,
            friction=friction,
            wrench_error=wrench_error,
            torque_error=torque_error,
            skin=skin,
        )
        self.zones = Zones(robot)
        self.classifier = Classifier(self.observer, self.detector.thresholds, self.zones)
        self.recorder = EventRecorder(self.detector, self.localizer, self.zones)
        self.contacts = ContactTable.empty(self.localizer)
        self._pending: list[LiveSample] = []
        self._touched = b""
        self._idle = np.zeros(len(robot.segment_names)).tobytes()

    @property
    def events(self) -> list[Event]:
        """All events so far, in the order of detection; one that lasts has `cleared` None."""
        self._record()
        self.recorder.locate_open()
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
        contacts: list[Contact] = []
        touched = detection.levels.tobytes()
        if touched != self._idle or self._touched != self._idle:
            contacts = self._follow(time, q, qd, estimate, detection, touched)
        else:
            self.classifier.core.step(float(time), estimate.rows, detection.levels)
        self._touched = touched
        return Result(estimate, contacts, detection, estimate.health)

    def run(
        self,
        time: ArrayLike,
        q: ArrayLike,
        qd: ArrayLike,
        tau: ArrayLike | None = None,
        wrench: ArrayLike | None = None,
    ) -> tuple[Estimate, Detection]:
        """Takes a recording or the next part of one.

        Afterwards `contacts` holds a row for each contact and sample of this part, and `events`
        tells what was found so far.
        """
        self._record()
        estimate, detection = self.detector.run(time, q, qd, tau, wrench)
        stamps, q, qd = (np.asarray(signal, dtype=float) for signal in (time, q, qd))
        contacts, ended = self.localizer.follow(self.classifier, stamps, q, qd, estimate, detection)
        ids = self.recorder.add(stamps, q, estimate, detection, contacts, ended)
        sample, segment = (contacts[:, column].astype(int) for column in (SAMPLE, SEGMENT))
        self.contacts = ContactTable(sample, segment, ids, contacts[:, ANSWER:], self.localizer)
        if len(stamps):
            self._touched = detection.levels[-1].tobytes()
        return estimate, detection

    def _follow(self, time, q, qd, estimate, detection, touched: bytes) -> list[Contact]:
        q, qd = np.array(q, float), np.ascontiguousarray(qd, float)
        contacts, ended = self.localizer.follow_sample(
            self.classifier, float(time), q, qd, estimate, detection
        )
        self._pending.append(LiveSample(float(time), q, estimate, detection, contacts, ended))
        numbers = contacts[:, NUMBER].tolist()
        events = self.recorder.open_events(numbers)
        changed = touched != self._touched or len(ended)
        if changed or len(events) < len(numbers) or len(self._pending) >= PENDING:
            self._record()
            events |= self.recorder.open_events(numbers)  # one may have ended with this sample
        return [
            LiveContact(row, estimate, events[number], self.localizer, self.zones)
            for row, number in zip(contacts, numbers, strict=True)
            if number in events
        ]

    def _record(self) -> None:
        """Hands the samples of a live stream on to the events."""
        samples, self._pending = self._pending, []
        if not samples:
            return
        for i, sample in enumerate(samples):
            sample.contacts[:, SAMPLE] = sample.ended[:, SAMPLE] = i
        self.recorder.add(
            np.array([sample.time for sample in samples]),
            np.array([sample.q for sample in samples]),
            self.observer.estimate(np.array([sample.estimate.rows for sample in samples])),
            Detection.joined([sample.detection for sample in samples]),
            np.concatenate([sample.contacts for sample in samples]),
            np.concatenate([sample.ended for sample in samples]),
        )
