# SPDX-License-Identifier: Apache-2.0
"""Events: from the sample at which a test fires to the one at which the contact is gone."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.contact.classification import Classes, Kind, of_contact
from touchline.contact.contact import Candidate
from touchline.contact.detector import Detection, Detector
from touchline.contact.localizer import CONTACT, FORCE, UNKNOWNS, EventAnswer, Localizer
from touchline.contact.zones import Zones
from touchline.estimation.observer import Estimate

Array = NDArray[np.float64]

STRONG = 0.5  # samples above this fraction of the event's peak speak for the event


@dataclass
class Event:
    """One contact from beginning to end; grows while it lasts.

    Attributes:
        id: number, from 0 in the order of detection.
        segment: name of the segment.
        level: "contact" or "collision": how it began, or a blow while it lasted.
        detected: time at which the test fired [s], not the onset.
        cleared: time at which it ended [s]; None while it lasts.
        joint: the most distal loaded joint; None where no torque tells.
        force: (3,) [N] in world, mean over the strong samples; None on `root`.
        force_peak: largest force [N]; None on `root`.
        torque_peak: largest external torque [Nm] on `joint`.
        status: as of a `Contact`, over the event.
        link: the link that carries the point, of the rigid `body`.
        body_probability: of that body, 0 to 1.
        position: (3,) [m] in world at `time_of_position`, from all strong samples.
        position_link: (3,) [m] the same in the frame of `link`.
        time_of_position: the last strong sample [s].
        position_std: root of the trace of its covariance [m].
        candidates: all explanations, best first, at `time_of_position`.
        rank: of contacts that cannot be told apart: independent equations, of the `unknowns`.
        decided: when the level was decided [s]; None while it is a default.
        zone: "structure", "end_effector" or "handle"; None while that is open.
        clamped: whether forces on two sides opposed each other; None where that is not known.
        rate: largest rate of the segment's force [N/s].
    """

    id: int
    segment: str
    level: str
    detected: float
    cleared: float | None = None
    joint: str | None = None
    force: Array | None = None
    force_peak: float | None = None
    torque_peak: float | None = None
    status: str = "wrench_only"
    link: str | None = None
    body: str | None = None
    body_probability: float | None = None
    position: Array | None = None
    position_link: Array | None = None
    time_of_position: float | None = None
    position_std: float | None = None
    candidates: tuple[Candidate, ...] = ()
    decided: float | None = None
    zone: str | None = None
    clamped: bool | None = False
    rate: float | None = None
    rank: int | None = None
    unknowns: int | None = None

    def as_json(self) -> dict[str, Any]:
        """The event as in `events.json`."""
        return {
            "id": self.id,
            "segment": self.segment,
            "level": self.level,
            "detected": self.detected,
            "cleared": self.cleared,
            "link": self.link,
            "body": self.body,
            "body_probability": self.body_probability,
            "position": _numbers(self.position),
            "position_link": _numbers(self.position_link),
            "time_of_position": self.time_of_position,
            "position_std": self.position_std,
            "force": _numbers(self.force),
            "force_peak": self.force_peak,
            "torque_peak": self.torque_peak,
            "status": self.status,
            "joint": self.joint,
            "decided": self.decided,
            "zone": self.zone,
            "clamped": self.clamped,
            "rate": self.rate,
            "rank": self.rank,
            "unknowns": self.unknowns,
            "candidates": [
                {
                    "link": candidate.link,
                    "body": candidate.body,
                    "probability": candidate.probability,
                    "position": _numbers(candidate.position),
                }
                | ({"radius": candidate.radius} if candidate.radius else {})
                for candidate in self.candidates
            ],
        }


def _numbers(values: Array | None) -> list[float] | None:
    return None if values is None else [float(x) for x in values]


def _classify(event: Event, time: Array, classes: Classes, part: "_Part", g: int) -> None:
    """Brings the class of an event up to date with samples of its segment."""
    samples = part.sample
    kinds, rates = of_contact(classes.kinds[samples, g], part.share), classes.rates[samples, g]
    known = np.flatnonzero(kinds >= Kind.CONTACT)
    blows = np.flatnonzero(kinds == Kind.COLLISION)
    if len(known) and event.decided is None:
        event.decided = float(time[samples][known[0]])
    if len(blows) and event.level != "collision":
        event.level, event.decided = "collision", float(time[samples][blows[0]])
    event.clamped = event.clamped or bool(classes.clamped[samples, g].any())
    if np.isfinite(rates).any():
        event.rate = max(event.rate or 0.0, float(np.nanmax(rates)))


class _Gathered:
    """What an event has brought so far, the same in whatever parts it comes."""

    def __init__(self, rows: int, joints: int) -> None:
        self.strength = 0.0  # the largest so far
        self.force = 0.0  # the largest norm, and the wrench and the joint positions then
        self.wrench, self.q = np.zeros(6), np.zeros(joints)
        self.torque = np.zeros(joints)  # the largest of each joint
        self.inseparable: Array | None = None  # the last answer that names a rank
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
        self._sum += rows[start:][strong].sum(axis=0)
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


@dataclass(frozen=True)
class _Part:
    """Samples of one contact: `sample` (M,), `share` (M,) of the segment's load, native answers."""

    sample: NDArray[np.int64]
    share: Array
    answers: Array


def load_shares(sample: NDArray[np.int64], segment: NDArray[np.int64], answers: Array) -> Array:
    """The share (M,) that each contact has of the forces on its segment; 1 for the only one."""
    size = np.linalg.norm(np.nan_to_num(answers[:, FORCE]), axis=1)
    key = sample * (segment.max(initial=0) + 1) + segment
    _, group, count = np.unique(key, return_inverse=True, return_counts=True)
    total = np.bincount(group, size)[group] if len(size) else size
    return np.where((count[group] > 1) & (total > 0.0), size / np.maximum(total, 1e-300), 1.0)


class EventRecorder:
    """Turns contacts into events, for a live stream or for a recording read in parts.

    `events` are all events so far; those of `open_events()` still last.

    Args:
        detector: that judges the samples.
        localizer: that follows the same samples, in the same parts.
    """

    def __init__(self, detector: Detector, localizer: Localizer) -> None:
        self._localizer = localizer
        self.events: list[Event] = []
        self._robot = detector.observer.robot
        self._rows = detector.thresholds.rows
        self._zones = Zones(self._robot)
        self._open: dict[float, tuple[Event, _Gathered]] = {}

    def open_events(self, numbers: list[float]) -> dict[float, Event]:
        """The events that last, of those with these numbers of contacts."""
        return {number: self._open[number][0] for number in numbers if number in self._open}

    def add(
        self,
        time: Array,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        classes: Classes,
        answers: Array,
        ended: Array,
    ) -> NDArray[np.int64]:
        """Takes N samples: `time` (N,) [s], `q` (N, n), and what was made of them.

        Args:
            time: (N,) [s].
            q: (N, n) [rad or m].
            estimate: of these samples.
            detection: of these samples.
            classes: of these samples.
            answers: (M, ...) the native answers, see `Localizer.follow`.
            ended: the native events that ended.

        Returns:
            (M,) the number of the event that each answer belongs to.
        """
        sample, segment, number = (answers[:, i].astype(int) for i in range(CONTACT))
        ids = np.full(len(answers), -1)
        shares = load_shares(sample, segment, answers[:, CONTACT:])
        _, first = np.unique(number, return_index=True)
        for row in np.sort(first).tolist():
            contact = int(number[row])
            own = np.flatnonzero(number == contact)
            g = int(segment[row])
            event, gathered = self._opened(contact, g, float(time[sample[row]]))
            ids[own] = event.id
            part = _Part(sample[own], shares[own], answers[own, CONTACT:])
            self._extend(event, gathered, g, part, q, estimate, detection)
            _classify(event, time, classes, part, g)
        for row in ended:
            self._close(int(row[2]), float(time[int(row[0])]), row[CONTACT:])
        return ids

    def locate_open(self) -> None:
        """Brings the places of the events that last up to date."""
        for number, answer in self._localizer.open_events().items():
            if number in self._open:
                self._place(*self._open[number], answer)

    def _place(self, event: Event, gathered: "_Gathered", answer: EventAnswer) -> None:
        for name, value in vars(answer).items():
            setattr(event, name, value)
        apart = gathered.inseparable
        if event.status == "not_separable" and apart is not None:
            last = self._localizer.answer(apart)
            event.rank, event.unknowns, event.candidates = (
                last.rank,
                last.unknowns,
                last.candidates,
            )
        event.zone = self._zones.of(event.segment, event.link)
        if not event.clamped:
            event.clamped = None if event.status == "not_separable" else False

    def _opened(self, number: int, g: int, time: float) -> tuple[Event, "_Gathered"]:
        if number not in self._open:
            event = Event(len(self.events), self._robot.segment_names[g], "contact", time)
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

    def _extend(
        self,
        event: Event,
        gathered: _Gathered,
        g: int,
        part: "_Part",
        q: Array,
        estimate: Estimate,
        detection: Detection,
    ) -> None:
        own = np.array([row.segment == g for row in self._rows])
        normalized = detection.normalized[part.sample]
        alone = part.share == 1.0
        wrenches = estimate.segment_wrench[part.sample, g].copy()
        wrenches[~alone, :3] = part.answers[~alone, FORCE]
        strength = part.share * np.abs(normalized[:, own]).max(axis=1)
        forces = np.nan_to_num(wrenches[:, :3])
        apart = np.flatnonzero(part.answers[:, UNKNOWNS] > 0)
        if len(apart):
            gathered.inseparable = part.answers[apart[-1]].copy()
        gathered.add_rows(strength, np.hstack([normalized, forces]))
        gathered.add_peaks(wrenches, q[part.sample], estimate.tau_ext[part.sample])
        if event.segment != "root":
            event.force, event.force_peak = gathered.mean[-3:], gathered.force
        self._name_joint(event, gathered)

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
