# SPDX-License-Identifier: Apache-2.0
"""From contacts, sample by sample, to events."""

import numpy as np
from numpy.typing import NDArray

from touchline.classifier.classifier import Kind
from touchline.classifier.zones import Zones
from touchline.detector.detector import Detection, Detector
from touchline.localizer.answer import (
    ANSWER,
    CLAMPED,
    ENDED,
    FORCE,
    KIND,
    NUMBER,
    RATE,
    SAMPLE,
    SEGMENT,
    SHARE,
    UNKNOWNS,
)
from touchline.localizer.localizer import Localizer
from touchline.observer.observer import Estimate
from touchline.result.event import Event, EventAnswer

Array = NDArray[np.float64]

STRONG = 0.5  # samples above this fraction of the event's peak speak for the event


class _Gathered:
    """What an event has brought so far, the same in whatever parts it comes."""

    def __init__(self, rows: int, joints: int) -> None:
        self.strength = 0.0  # the largest so far
        self.force = 0.0  # the largest norm, and the wrench and the joint positions then
        self.wrench, self.q = np.zeros(6), np.zeros(joints)
        self.torque = np.zeros(joints)  # the largest of each joint
        self.undetermined: Array | None = None  # the last answer that names a rank
        self._sum = np.zeros(rows)
        self._count = 0

    def add_rows(self, strength: Array, rows: Array) -> None:
        """For the mean over the samples that come near the peak of those up to then."""
        peaks = np.maximum.accumulate(np.concatenate([[self.strength], strength]))
        leaps = np.flatnonzero(STRONG * strength > peaks[:-1])
        if len(leaps):  # all that came before was weak
            self._sum[:] = 0.0
            self._count = 0
        start = leaps[-1] if len(leaps) else 0
        strong = strength[start:] >= STRONG * peaks[start + 1 :]
        # One after the other: the same bits in whatever parts the samples come.
        self._sum = np.cumsum(np.vstack([self._sum, rows[start:][strong]]), axis=0)[-1]
        self._count += int(strong.sum())
        self.strength = float(peaks[-1])

    def add_peaks(self, wrenches: Array, q: Array, tau_ext: Array) -> None:
        """Wrenches (N, 6), NaN where there is none, with joint positions and torques (N, n)."""
        norms = np.linalg.norm(np.nan_to_num(wrenches[:, :3]), axis=1)
        largest = int(np.argmax(norms))
        if norms[largest] > self.force:
            self.force = float(norms[largest])
            self.wrench, self.q = wrenches[largest].copy(), q[largest].copy()
        self.torque = np.maximum(self.torque, np.abs(np.nan_to_num(tau_ext)).max(axis=0))

    @property
    def mean(self) -> Array:
        return self._sum / max(self._count, 1)


class EventRecorder:
    """Turns contacts into events, for a live stream or for a recording read in parts.

    `events` are all events so far; those of `open_events()` still last.

    Args:
        detector: that judges the samples.
        localizer: that follows the same samples, in the same parts.
        zones: of the robot.
    """

    def __init__(self, detector: Detector, localizer: Localizer, zones: Zones) -> None:
        self._localizer, self._zones = localizer, zones
        self.events: list[Event] = []
        self._robot = detector.observer.robot
        self._rows = detector.thresholds.rows
        self._open: dict[int, tuple[Event, _Gathered]] = {}

    def open_events(self, numbers: list[float]) -> dict[float, Event]:
        """The events that last, of those with these numbers of contacts."""
        return {number: self._open[int(number)][0] for number in numbers if number in self._open}

    def add(
        self,
        time: Array,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        contacts: Array,
        ended: Array,
    ) -> NDArray[np.int64]:
        """Takes N samples: `time` (N,) [s], `q` (N, n), and what was made of them.

        Args:
            time: (N,) [s].
            q: (N, n) [rad or m].
            estimate: of these samples.
            detection: of these samples.
            contacts: (M, w) the contacts, see `Localizer.follow`.
            ended: the native events that ended.

        Returns:
            (M,) the number of the event that each contact belongs to.
        """
        ids = np.full(len(contacts), -1)
        numbers = contacts[:, NUMBER].astype(int)
        _, first = np.unique(numbers, return_index=True)
        for row in np.sort(first).tolist():
            own = np.flatnonzero(numbers == numbers[row])
            part, g = contacts[own], int(contacts[row, SEGMENT])
            sample = part[:, SAMPLE].astype(int)
            event, gathered = self._opened(int(numbers[row]), g, float(time[sample[0]]))
            ids[own] = event.id
            wrenches = _loads(estimate.segment_wrench[sample, g], part)
            gathered.add_peaks(wrenches, q[sample], estimate.tau_ext[sample])
            self._weigh(gathered, g, part, wrenches, detection.normalized[sample])
            if event.segment != "root":
                event.force, event.force_peak = gathered.mean[-3:], gathered.force
            self._name_joint(event, gathered)
            _classify(event, time[sample], part)
        for row in ended:
            self._close(int(row[NUMBER]), float(time[int(row[SAMPLE])]), row[ENDED:])
        return ids

    def locate_open(self) -> None:
        """Brings the places of the events that last up to date."""
        for number, answer in self._localizer.open_events().items():
            if number in self._open:
                self._place(*self._open[number], answer)

    def _place(self, event: Event, gathered: _Gathered, answer: EventAnswer) -> None:
        for name, value in vars(answer).items():
            setattr(event, name, value)
        if gathered.undetermined is not None:
            last = self._localizer.answer(gathered.undetermined)
            if event.status == last.status:
                event.rank, event.unknowns = last.rank, last.unknowns
            if event.status == last.status == "not_separable":
                event.candidates = last.candidates
        event.zone = self._zones.of(event.segment, event.link)
        if not event.clamped:
            event.clamped = None if event.status == "not_separable" else False

    def _opened(self, number: int, g: int, time: float) -> tuple[Event, _Gathered]:
        if number not in self._open:
            segment = self._robot.segment_names[g]
            event = Event(id=len(self.events), segment=segment, level="contact", detected=time)
            event.zone = self._zones.of(event.segment)
            self.events.append(event)
            gathered = _Gathered(len(self._rows) + 3, len(self._robot.joint_names))
            self._open[number] = (event, gathered)
        return self._open[number]

    def _close(self, number: int, time: float, place: Array) -> None:
        event, gathered = self._open.pop(number)
        event.cleared = time
        self._place(event, gathered, self._localizer.event_answer(place))
        self._name_joint(event, gathered)

    def _weigh(
        self, gathered: _Gathered, g: int, part: Array, wrenches: Array, normalized: Array
    ) -> None:
        """Adds contacts (M, w) on segment g to the means of their event."""
        own = np.array([row.segment == g for row in self._rows])
        strength = part[:, SHARE] * np.abs(normalized[:, own]).max(axis=1)
        gathered.add_rows(strength, np.hstack([normalized, np.nan_to_num(wrenches[:, :3])]))
        apart = np.flatnonzero(part[:, ANSWER + UNKNOWNS] > 0)
        if len(apart):
            gathered.undetermined = part[apart[-1], ANSWER:].copy()

    def _name_joint(self, event: Event, gathered: _Gathered) -> None:
        mean, names = gathered.mean, self._robot.joint_names
        loaded = [
            (row.joint, abs(mean[i]))
            for i, row in enumerate(self._rows)
            if self._robot.segment_names[row.segment] == event.segment and row.joint >= 0
        ]
        beyond = [joint for joint, x in loaded if x > 1.0]
        if beyond:
            joint = max(beyond, key=self._robot.joint_depth)
        elif event.segment != "root":
            joint = self._inboard_joint(event.segment, gathered)
        else:
            joint = max(loaded, key=lambda pair: pair[1])[0] if loaded else None
        event.joint = None if joint is None else names[joint]
        measured = joint is not None and gathered.torque[joint] > 0.0
        event.torque_peak = float(gathered.torque[joint]) if measured else None

    def _inboard_joint(self, segment: str, gathered: _Gathered) -> int | None:
        """The most distal joint inboard of a segment that its wrench loads beyond its threshold."""
        limits = {row.joint: row.contact for row in self._rows if row.joint >= 0}
        loads = self._robot.torques_of_wrench(segment, gathered.q, gathered.wrench)
        for joint, torque in reversed(loads):
            if joint in limits and abs(torque) > limits[joint]:
                return joint
        return None


def _loads(wrenches: Array, part: Array) -> Array:
    """The wrenches (M, 6) of a segment, with the contact's own force where there are others."""
    loads, shared = wrenches.copy(), part[:, SHARE] < 1.0
    loads[shared, :3] = part[shared, ANSWER:][:, FORCE]
    return loads


def _classify(event: Event, time: Array, part: Array) -> None:
    """Brings the class of an event up to date with contacts (M, w) at `time` (M,)."""
    known = np.flatnonzero(part[:, KIND] >= Kind.CONTACT)
    blows = np.flatnonzero(part[:, KIND] == Kind.COLLISION)
    if len(known) and event.decided is None:
        event.decided = float(time[known[0]])
    if len(blows) and event.level != "collision":
        event.level, event.decided = "collision", float(time[blows[0]])
    event.clamped = event.clamped or bool((part[:, CLAMPED] == 1.0).any())
    rates = part[:, RATE]
    if np.isfinite(rates).any():
        event.rate = max(event.rate or 0.0, float(np.nanmax(rates)))
