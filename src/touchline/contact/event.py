# SPDX-License-Identifier: Apache-2.0
"""Events: from the sample at which a test fires to the one at which the contact is gone."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.contact.contact import Candidate
from touchline.contact.detector import Detection, Detector, Level
from touchline.contact.localizer import EventAnswer, Localizer
from touchline.estimation.observer import Estimate

Array = NDArray[np.float64]

STRONG = 0.5  # samples above this fraction of the event's peak speak for the event


@dataclass
class Event:
    """One contact from beginning to end; grows while it lasts.

    Attributes:
        id: number, from 0 in the order of detection.
        segment: name of the segment.
        level: "contact" or "collision", the highest reached.
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
            "candidates": [
                {
                    "link": candidate.link,
                    "body": candidate.body,
                    "probability": candidate.probability,
                    "position": _numbers(candidate.position),
                }
                for candidate in self.candidates
            ],
        }


def _numbers(values: Array | None) -> list[float] | None:
    return None if values is None else [float(x) for x in values]


def _place(event: Event, answer: EventAnswer) -> None:
    for name, value in vars(answer).items():
        setattr(event, name, value)


class _Strongest:
    """Mean of rows over the samples that come near the peak, gathered part by part.

    Attributes:
        peak: the largest strength.
        force: the largest force [N]; `wrench` (6,) and `q` (n,) are those of its sample.
        torques: (n,) largest external torque of each joint [Nm], NaN where none is known.
    """

    def __init__(self, width: int, joints: int) -> None:
        self.force, self.wrench, self.q = -1.0, np.zeros(6), np.zeros(joints)
        self.torques = np.full(joints, np.nan)
        self.peak = 0.0
        self._sum = np.zeros(width)
        self._count = 0

    def add(self, strength: Array, rows: Array) -> None:
        peak = float(np.max(strength, initial=0.0))
        if peak * STRONG > self.peak:  # all that came before was weak
            self._sum[:] = 0.0
            self._count = 0
        self.peak = max(self.peak, peak)
        strong = strength >= STRONG * self.peak
        self._sum += rows[strong].sum(axis=0)
        self._count += int(strong.sum())

    def add_loads(self, q: Array, wrenches: Array, torques: Array) -> None:
        """Takes the positions, the segment's wrenches and the joints' torques of a part."""
        self.torques = np.fmax(self.torques, np.fmax.reduce(np.abs(torques)))
        norms = np.linalg.norm(np.nan_to_num(wrenches[:, :3]), axis=1)
        row = int(norms.argmax())
        if norms[row] > self.force:
            self.force, self.wrench, self.q = float(norms[row]), wrenches[row], q[row]

    @property
    def mean(self) -> Array:
        return self._sum / max(self._count, 1)


class EventRecorder:
    """Turns levels into events, for a live stream or for a recording read in parts.

    `events` are all events so far; those of `open_events()` still last.

    Args:
        detector: that judges the samples.
        localizer: that follows the same samples, in the same parts; None: no places.
    """

    def __init__(self, detector: Detector, localizer: Localizer | None = None) -> None:
        self._localizer = localizer
        self.events: list[Event] = []
        self._robot = detector.observer.robot
        self._rows = detector.thresholds.rows
        self._open: dict[int, tuple[Event, _Strongest]] = {}
        self._announced: dict[tuple[int, int], Event] = {}  # by segment and sample of a part

    def open_events(self) -> dict[int, Event]:
        """Events that last, by number of their segment."""
        return {segment: event for segment, (event, _) in self._open.items()}

    def add(
        self,
        time: Array,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        ended: Array | None = None,
    ) -> NDArray[np.int64]:
        """Takes N samples: `time` (N,) [s], `q` (N, n), and what was made of them.

        Args:
            time: (N,) [s].
            q: (N, n) [rad or m].
            estimate: of these samples.
            detection: of these samples.
            ended: the native events that ended, see `Localizer.follow`.

        Returns:
            (N, m) the number of the event on each segment, -1 where there is none.
        """
        ids = np.full(detection.levels.shape, -1)
        self._announce(time, detection.levels)
        for g in range(len(self._robot.segment_names)):
            levels = detection.levels[:, g]
            if g in self._open or levels.any():
                places = [row[2:] for row in ended if row[1] == g] if ended is not None else []
                self._add_segment(g, levels, time, q, estimate, detection, ids, places)
        return ids

    def locate_open(self) -> None:
        """Brings the places of the events that last up to date."""
        if self._localizer is None:
            return
        for g, (event, _) in self._open.items():
            _place(event, self._localizer.event(g))

    def _announce(self, time: Array, levels: Array) -> None:
        """Numbers the events that begin in these samples in the order in which they do."""
        active = levels > 0
        before = np.zeros_like(active[:1])
        before[:, list(self._open)] = True
        rises = np.argwhere(active & ~np.vstack([before, active[:-1]]))
        self._announced = {}
        for row, g in rises.tolist():
            name = self._robot.segment_names[g]
            event = Event(len(self.events), name, "contact", float(time[row]))
            self.events.append(event)
            self._announced[g, row] = event

    def _add_segment(
        self,
        g: int,
        levels: Array,
        time: Array,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        ids: NDArray[np.int64],
        places: list[Array],
    ) -> None:
        active = levels > 0
        edges = np.flatnonzero(np.diff(active.astype(int), prepend=int(g in self._open)))
        bounds = sorted({0, *edges.tolist(), len(time)})  # an edge may be the first sample
        for start, stop in zip(bounds[:-1], bounds[1:], strict=True):
            if start in edges and not active[start]:
                self._close(g, float(time[start]), places)
            if start == stop or not active[start]:
                continue
            if g not in self._open:
                event = self._announced[g, start]
                self._open[g] = (event, _Strongest(len(self._rows) + 3, q.shape[1]))
            ids[start:stop, g] = self._open[g][0].id
            self._extend(g, slice(start, stop), levels, q, estimate, detection)

    def _close(self, g: int, time: float, places: list[Array]) -> None:
        event, _ = self._open.pop(g)
        event.cleared = time
        if self._localizer is not None and places:
            _place(event, self._localizer.event_answer(places.pop(0)))

    def _extend(
        self, g: int, part: slice, levels: Array, q: Array, estimate: Estimate, detection: Detection
    ) -> None:
        event, strongest = self._open[g]
        own = np.array([row.segment == g for row in self._rows])
        normalized = detection.normalized[part]
        strength = np.abs(normalized[:, own]).max(axis=1)
        forces = np.nan_to_num(estimate.segment_wrench[part, g, :3])
        strongest.add(strength, np.hstack([normalized, forces]))
        strongest.add_loads(q[part], estimate.segment_wrench[part, g], estimate.tau_ext[part])
        if levels[part].max() >= Level.COLLISION:
            event.level = "collision"
        if event.segment != "root":
            event.force = strongest.mean[-3:]
            event.force_peak = strongest.force
        self._name_joint(event, g, strongest)
        if event.joint is not None:
            torque = strongest.torques[self._robot.joint_names.index(event.joint)]
            event.torque_peak = float(torque) if np.isfinite(torque) else None

    def _name_joint(self, event: Event, g: int, strongest: _Strongest) -> None:
        mean = strongest.mean
        loaded = [
            (row.joint, abs(mean[i]))
            for i, row in enumerate(self._rows)
            if row.segment == g and row.joint >= 0
        ]
        beyond = [joint for joint, x in loaded if x > 1.0]
        if beyond:
            event.joint = self._robot.joint_names[max(beyond, key=self._robot.joint_depth)]
        elif event.segment != "root":
            event.joint = self._inboard_joint(event.segment, strongest.q, strongest.wrench)
        elif loaded:
            event.joint = self._robot.joint_names[max(loaded, key=lambda pair: pair[1])[0]]

    def _inboard_joint(self, segment: str, q: Array, wrench: Array) -> str | None:
        """The most distal joint inboard of a segment that its wrench loads beyond its threshold."""
        limits = {row.joint: row.contact for row in self._rows if row.joint >= 0}
        for joint, torque in reversed(self._robot.torques_of_wrench(segment, q, wrench)):
            if joint in limits and abs(torque) > limits[joint]:
                return self._robot.joint_names[joint]
        return None
