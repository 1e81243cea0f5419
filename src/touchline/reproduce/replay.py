# SPDX-License-Identifier: Apache-2.0
"""A simulated log taken through detection and localization, with its truth beside it."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Mask
from touchline.model.robot import Robot
from touchline.observer.observer import Estimate, Observer
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.simulation.truth import Simulated, filter_truth

FORCE = slice(0, 3)
GRACE = 0.1  # an event may outlast its contact by this much [s], for the filters to empty
TRACE = 1e-3  # a force above it is a contact [N]


@dataclass(frozen=True)
class Delay:
    """How a true contact was found.

    Attributes:
        segment: that was touched.
        start: when its force began [s].
        delay: from there to detection [s]; NaN if it was missed.
        force: that it had then [N].
    """

    segment: str
    start: float
    delay: float
    force: float


class Replay:
    """What the methods make of a simulated log.

    Args:
        robot: that was simulated.
        simulated: the log and its truth.
        bandwidth: K [rad/s] of all observers; default: the description's.
    """

    def __init__(self, robot: Robot, simulated: Simulated, bandwidth: float | None = None) -> None:
        self.robot, self.simulated = robot, simulated
        samples = simulated.samples
        self.time = samples.time
        self.signals = (samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
        self.pipeline = Pipeline(robot, bandwidth)
        self.estimate, self.detection = self.pipeline.run(*self.signals)
        self._bandwidth = bandwidth

    @cached_property
    def paper(self) -> Estimate:
        """The extended observer as printed."""
        return Observer(self.robot, self._bandwidth, "paper").run(*self.signals)

    @cached_property
    def _segment_of(self) -> dict[str, str]:
        return {link: body.segment for body in self.robot.bodies for link in body.links}

    def _own(self, segment: str) -> Mask:
        """Which slots (N, c) of the truth touch a segment now."""
        truth = self.simulated.truth
        own = [i for i, link in enumerate(truth.links) if self._segment_of.get(link) == segment]
        return np.isin(truth.link, own)

    def true_force(self, segment: str) -> Array:
        """The force (N, 3) [N] on a segment, world axes."""
        return np.einsum("nc,ncx->nx", self._own(segment), self.simulated.truth.force)

    def true_point(self, segment: str) -> Array:
        """Where a segment is touched (N, 3) [m], world; NaN unless by exactly one contact."""
        own, points = self._own(segment), self.simulated.truth.point
        one = own.sum(axis=1) == 1
        point = np.einsum("nc,ncx->nx", own, np.nan_to_num(points))
        return np.where(one[:, None], point, np.nan)

    def filtered_truth(self, segment: str) -> Array:
        """The true wrench (N, 6) on a segment, low-passed as the observer does it."""
        names = self.robot.segment_names
        mean = self.simulated.truth.segment_wrench_mean(names, self._segment_of)
        sensors = self.robot.description.bandwidth_sensors
        K = self._bandwidth or sensors[segment]
        return filter_truth(mean[:, names.index(segment)], self.time, K)

    def wrench(self, segment: str, estimate: Estimate | None = None) -> Array:
        """The estimated wrench (N, 6) on a segment, world axes, about the origin."""
        index = self.robot.segment_names.index(segment)
        return (estimate or self.estimate).segment_wrench[:, index]

    def located(self, segment: str) -> Array:
        """Estimated points (N, 3) [m], world; NaN where none is given."""
        table = self.pipeline.contacts
        points = np.full((len(self.time), 3), np.nan)
        if table is not None and len(table):
            columns = table.columns()
            own = columns["segment"] == segment
            points[table.sample[own]] = np.column_stack([columns[axis][own] for axis in "xyz"])
        return points

    def links(self, segment: str) -> NDArray[np.object_]:
        """Estimated links (N,); None where none is given."""
        table = self.pipeline.contacts
        links = np.full(len(self.time), None, dtype=object)
        if table is not None and len(table):
            columns = table.columns()
            own = columns["segment"] == segment
            links[table.sample[own]] = columns["link"][own]
        return links

    def found(self, segment: str) -> Mask:
        """Where (N,) a segment is held to be touched."""
        return self.detection.levels[:, self.robot.segment_names.index(segment)] > 0

    def spans(self, segment: str) -> list[tuple[float, float]]:
        """From when to when a segment was really touched [s]."""
        touched = np.linalg.norm(self.true_force(segment), axis=1) > TRACE
        edges = np.flatnonzero(np.diff(np.r_[0, touched.astype(int), 0]))
        last = len(self.time) - 1
        raw = [
            (float(self.time[a]), float(self.time[min(b, last)]))
            for a, b in edges.reshape(-1, 2).tolist()
        ]
        return _joined(raw)

    def delays(self) -> list[Delay]:
        """How fast each true contact was found."""
        return [
            self._delay(segment, start, end)
            for segment in self.robot.segment_names
            for start, end in self.spans(segment)
        ]

    def _delay(self, segment: str, start: float, end: float) -> Delay:
        during = (self.time >= start) & (self.time <= end) & self.found(segment)
        if not during.any():
            return Delay(segment, start, float("nan"), float("nan"))
        row = int(np.argmax(during))
        force = float(np.linalg.norm(self.true_force(segment)[row]))
        return Delay(segment, start, float(self.time[row]) - start, force)

    def false_events(self) -> list[Event]:
        """Events on segments that nothing touched meanwhile."""
        return [e for e in self.pipeline.events if not self._is_true(e)]

    def _is_true(self, event: Event) -> bool:
        cleared = event.cleared if event.cleared is not None else float(self.time[-1])
        return any(
            event.detected < end + GRACE and cleared > start
            for start, end in self.spans(event.segment)
        )


def _joined(spans: list[tuple[float, float]]) -> list[tuple[float, float]]:
    """Touches that follow each other within `GRACE` are one."""
    out: list[tuple[float, float]] = []
    for start, end in spans:
        if out and start - out[-1][1] < GRACE:
            out[-1] = (out[-1][0], end)
        else:
            out.append((start, end))
    return out
