# SPDX-License-Identifier: Apache-2.0
"""What was said of many pushes in one recording: one event belongs to one push."""

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np

from touchline.arrays import Array, Mask
from touchline.bench.matching import match
from touchline.result.event import Event
from touchline.result.kinds import Status

SURE = 0.9  # probability of a body: one that is named for sure
NEAR = 0.05  # m; a located place further off is wrong
LATE = 0.3  # s, after which a push that is over must have ended
EARLY = 0.02  # s before the release by which an event may end: a push falls before the release


@dataclass(frozen=True)
class Push:
    """A push as it was.

    Attributes:
        begin, release, end: when the force begins to rise, begins to fall, and is gone [s].
        body: that was pushed.
        path: (N, 3) [m] where, at each sample of the recording; NaN while it is not there.
    """

    begin: float
    release: float
    end: float
    body: str
    path: Array


@dataclass(frozen=True)
class Tally:
    """What came of the pushes of some recordings; counts but for the times.

    Attributes:
        pushes: how many there were.
        found: with an event of their own.
        extra: events beyond those.
        placed: found, and located.
        bodiless: found, but no body is named.
        right: found, and the named body is the pushed one.
        sure_wrong: events that name a body that is not pushed with probability `SURE` or more.
        far: events located more than `NEAR` off, or where nothing touches.
        held: found, and the event lasts until the release.
        cleared: pushes after which no event that was there lasts longer than `LATE`.
        idle: in contact later than `LATE` after a push, and before the next [s].
        free: of that kind of time there is [s].
    """

    pushes: int = 0
    found: int = 0
    extra: int = 0
    placed: int = 0
    bodiless: int = 0
    right: int = 0
    sure_wrong: int = 0
    far: int = 0
    held: int = 0
    cleared: int = 0
    idle: float = 0.0
    free: float = 0.0

    def __add__(self, other: "Tally") -> "Tally":
        """Of both."""
        return Tally(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(Tally)))


def judge(time: Array, pushes: Sequence[Push], events: Sequence[Event]) -> Tally:
    """Compares what was said of a recording with what was done.

    Args:
        time: of its samples [s].
        pushes: in their order.
        events: all of them.
    """
    last = float(time[-1])
    spans = np.array([(e.detected, _ended(e, last)) for e in events]).reshape(-1, 2)
    touches = np.array([(p.begin, p.end) for p in pushes]).reshape(-1, 2)
    pairs = match(touches, spans)
    found = [(pushes[p], events[e]) for p, e in pairs]
    felt = _mask(time, spans)
    free = ~_mask(time, touches + [0.0, LATE])
    step = last / max(len(time) - 1, 1)
    return Tally(
        pushes=len(pushes),
        found=len(pairs),
        extra=len(events) - len(pairs),
        placed=sum(e.status == Status.LOCATED for _, e in found),
        bodiless=sum(e.body is None for _, e in found),
        right=sum(e.body == p.body for p, e in found),
        sure_wrong=sum(_sure_wrong(e, pushes) for e in events),
        far=sum(_far(e, time, pushes) for e in events),
        held=sum(_ended(e, last) >= p.release - EARLY for p, e in found),
        cleared=sum(
            not ((spans[:, 0] <= p.end) & (spans[:, 1] > p.end + LATE)).any() for p in pushes
        ),
        idle=step * float((felt & free).sum()),
        free=step * float(free.sum()),
    )


def _ended(event: Event, last: float) -> float:
    return last if event.cleared is None else event.cleared


def _mask(time: Array, spans: Array) -> Mask:
    """Which samples lie in any of these spans."""
    inside = np.zeros(len(time), bool)
    for begin, end in spans:
        inside |= (time >= begin) & (time <= end)
    return inside


def _sure_wrong(event: Event, pushes: Sequence[Push]) -> bool:
    if event.body is None or (event.body_probability or 0.0) < SURE:
        return False
    over = np.inf if event.cleared is None else event.cleared
    pushed = {p.body for p in pushes if event.detected <= p.end and over >= p.begin}
    return event.body not in pushed


def _far(event: Event, time: Array, pushes: Sequence[Push]) -> bool:
    at = event.time_of_position
    if event.status != Status.LOCATED or event.position is None or at is None:
        return False
    near = [p for p in pushes if p.begin <= at <= p.end + LATE]
    return not any(_off(event.position, at, time, p) <= NEAR for p in near)


def _off(position: Array, at: float, time: Array, push: Push) -> float:
    """Distance from the touched point, where it was last [m]."""
    there = np.flatnonzero(np.isfinite(push.path[:, 0]))
    k = there[np.argmin(np.abs(time[there] - at))]
    return float(np.linalg.norm(position - push.path[k]))
