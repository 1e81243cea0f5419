# SPDX-License-Identifier: Apache-2.0
"""What came out of the recordings, and by how much it differs from another time."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from touchline.bench.matching import match
from touchline.bench.tuning.recordings import PERIOD, Recording
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event

WORSE = 0.1  # of the error of places, from which a change counts
LATER = 1.0  # ms of detection, likewise


@dataclass
class Outcome:
    """Of all recordings together.

    Attributes:
        touches: that there were, of which `found` have an event of their own on their segment.
        right: of those found, on the right body.
        false: events that belong to no touch.
        faults: changes that were told of channels.
        errors: of the places of events on the right body [m].
        delays: from the beginning of a touch to its event [s].
        told: all that was said, to compare.
    """

    touches: int = 0
    found: int = 0
    right: int = 0
    false: int = 0
    faults: int = 0
    errors: list[float] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    told: list[str] = field(default_factory=list)

    @property
    def error(self) -> float:
        """Root mean square error of places [mm]."""
        return 1e3 * float(np.sqrt(np.mean(np.square(self.errors)))) if self.errors else np.nan

    @property
    def delay(self) -> float:
        """Mean delay of detection [ms]."""
        return 1e3 * float(np.mean(self.delays)) if self.delays else np.nan

    def text(self) -> str:
        """In one line."""
        return (
            f"{self.found} of {self.touches} touches found, {self.right} on the right body, "
            f"{self.false} false events, {self.faults} changes of faults, places "
            f"{self.error:.2f} mm (RMS) and detection {self.delay:.1f} ms off"
        )


def outcome(recordings: Sequence[Recording], tuning: Mapping[str, float]) -> Outcome:
    """Of a pipeline with some tuning numbers changed."""
    all_of_them = Outcome()
    for recording in recordings:
        pipeline = Pipeline(
            recording.robot,
            period=PERIOD,
            skin=recording.skin,
            thresholds=recording.thresholds,
            tuning=tuning,
        )
        s = recording.samples
        pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
        judge(recording, pipeline.events, all_of_them)
        all_of_them.faults += len(pipeline.faults)
        all_of_them.told.append(str([(f.sample, f.channel, f.fault) for f in pipeline.faults]))
    return all_of_them


def judge(recording: Recording, events: Sequence[Event], into: Outcome) -> None:
    """One event to one touch, on the segment of that."""
    time = recording.samples.time
    into.touches += len(recording.touches)
    into.told += [json.dumps(event.as_json(), sort_keys=True) for event in events]
    for segment in recording.robot.segment_names:
        touches = [t for t in recording.touches if t.segment == segment]
        own = [e for e in events if e.segment == segment]
        ends = [np.inf if e.cleared is None else e.cleared for e in own]
        pairs = match(
            np.array([[t.begin, t.end] for t in touches]).reshape(-1, 2),
            np.array([[e.detected, end] for e, end in zip(own, ends, strict=True)]).reshape(-1, 2),
            alike=np.array([[t.body == e.body for e in own] for t in touches]),
        )
        into.found += len(pairs)
        into.false += len(own) - len(pairs)
        for t, e in pairs:
            touch, event = touches[t], own[e]
            into.delays.append(event.detected - touch.begin)
            if event.body != touch.body or event.position is None:
                continue
            into.right += 1
            at = int(np.searchsorted(time, event.time_of_position or touch.end))
            true = touch.point[min(at, len(time) - 1)]
            if np.isfinite(true).all():
                into.errors.append(float(np.linalg.norm(event.position - true)))


def effect(usual: Outcome, other: Outcome) -> str:
    """What is different: "=" nothing at all, "~" nothing that counts."""
    if usual.told == other.told:
        return "="
    parts = []
    for name in ("found", "right", "false", "faults"):
        before, now = getattr(usual, name), getattr(other, name)
        if before != now:
            parts.append(f"{name} {now - before:+d}")
    if np.isnan(other.error) and not np.isnan(usual.error):
        parts.append("a place is not a number")
    elif not abs(other.error - usual.error) <= WORSE * usual.error:
        parts.append(f"{other.error - usual.error:+.2f} mm")
    if not abs(other.delay - usual.delay) <= LATER:
        parts.append(f"{other.delay - usual.delay:+.0f} ms")
    return ", ".join(parts) or "~"
