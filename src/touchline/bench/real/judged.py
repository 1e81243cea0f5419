# SPDX-License-Identifier: Apache-2.0
"""What was made of a recording, counted."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields

import numpy as np

from touchline.arrays import Array
from touchline.bench.matching import match
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.trials.real_recordings import Recording

SET = 0.9  # of the probability, that the smallest set of links holds
SURE = 0.9  # probability of the link named first


@dataclass(frozen=True)
class Touched:
    """Touches of a recording, and what was told of them; counts, to be added up.

    Attributes:
        touches: that there were.
        found: that one event of their own stands for.
        false: events that are no touch.
        right: touches whose link is named first.
        beyond: touches for which a link further out is named first.
        in_set: touches whose link is in the smallest set that holds `SET` of the probability.
        in_two: touches whose link is among the two named first.
        sure, sure_wrong: touches with a probability above `SURE`, and those of another link.
        links: sum of the sizes of the sets.
    """

    touches: int = 0
    found: int = 0
    false: int = 0
    right: int = 0
    beyond: int = 0
    in_set: int = 0
    in_two: int = 0
    sure: int = 0
    sure_wrong: int = 0
    links: int = 0

    @staticmethod
    def sum(parts: Iterable["Touched"]) -> "Touched":
        """All of them together."""
        parts = list(parts)
        return Touched(*(sum(getattr(p, f.name) for p in parts) for f in fields(Touched)))


@dataclass(frozen=True)
class Free:
    """Motion in which nothing touches.

    Attributes:
        seconds: of motion.
        share: of the time in contact.
        longest: event [s].
        events: how many.
        open: does one last to the end?
    """

    seconds: float
    share: float
    longest: float
    events: int
    open: bool


def events_of(recording: Recording, tuning: Mapping[str, float] | None = None) -> list[Event]:
    """What the pipeline makes of a recording, with some tuning numbers changed."""
    pipeline = Pipeline(recording.robot, period=recording.period, tuning=tuning)
    s = recording.samples
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return pipeline.events


def judge_touched(recording: Recording, events: list[Event]) -> Touched:
    """One event to one touch."""
    pairs = match(recording.touches, spans(events))
    told = [_told(events[e], recording.link) for _, e in pairs]
    counts = [Touched(touches=len(recording.touches), false=len(events) - len(pairs)), *told]
    return Touched.sum(counts)


def judge_free(recording: Recording, events: list[Event]) -> Free:
    """How long an arm that nothing touches is told to be touched."""
    time = recording.samples.time
    intervals = np.minimum(spans(events), time[-1])
    inside = np.zeros(len(time), bool)
    for begin, end in intervals:
        inside |= (time >= begin) & (time < end)
    lengths = intervals[:, 1] - intervals[:, 0]
    return Free(
        float(time[-1] - time[0]),
        float(inside.mean()),
        float(lengths.max(initial=0.0)),
        len(events),
        any(event.cleared is None for event in events),
    )


def spans(events: list[Event]) -> Array:
    """(E, 2) begin and end [s], infinite where an event has not ended."""
    ends = [np.inf if e.cleared is None else e.cleared for e in events]
    return np.array([(e.detected, end) for e, end in zip(events, ends, strict=True)]).reshape(-1, 2)


def link_shares(event: Event) -> dict[int, float]:
    """Probability of each link by its number, the last digit of its body's name."""
    shares: dict[int, float] = {}
    for candidate in event.candidates:
        number = int(candidate.body[-1])
        shares[number] = shares.get(number, 0.0) + candidate.probability
    return shares


def _told(event: Event, link: int) -> Touched:
    """A touch that was found."""
    shares = sorted(link_shares(event).items(), key=lambda item: -item[1])
    if not shares:  # no link is named: it is none of them
        return Touched(found=1)
    names = [number for number, _ in shares]
    held = np.cumsum([share for _, share in shares])
    size = min(int(np.searchsorted(held, SET * held[-1])) + 1, len(names))
    first, share = shares[0]
    return Touched(
        found=1,
        right=int(first == link),
        beyond=int(first > link),
        in_set=int(link in names[:size]),
        in_two=int(link in names[:2]),
        sure=int(share > SURE),
        sure_wrong=int(share > SURE and first != link),
        links=size,
    )
