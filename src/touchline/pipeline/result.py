# SPDX-License-Identifier: Apache-2.0
"""What one sample brought."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.detector.detector import Detection
from touchline.native import core
from touchline.observer.observer import Estimate
from touchline.result.contact import Contact
from touchline.result.event import Event, EventChange
from touchline.result.fault import ChannelFault, faults_of
from touchline.result.kinds import Happened, Watch
from touchline.result.native import Names
from touchline.result.reset import Reset, resets_of
from touchline.value import Value, lazily

HAPPENED = tuple(Happened)  # in the order of the core
WATCH = tuple(Watch)  # likewise


class Layout:
    """Where the parts of a native snapshot stand.

    Args:
        native: whose snapshots they are.
        estimate: slices of the observer's row.
        names: of the robot.
        channels: names of its channels.
        estimates: names of what is estimated, and how many numbers each has.
    """

    def __init__(
        self,
        native: core.Pipeline,
        estimate: dict[str, slice],
        names: Names,
        channels: tuple[str, ...],
        estimates: tuple[tuple[str, int], ...],
    ) -> None:
        slices = {name: slice(*ends) for name, ends in native.slices.items()}
        self.estimate, self.names = estimate, names
        self.channels, self.estimates = channels, estimates
        self.row, self.levels = slices["row"], slices["levels"]
        self.normalized, self.drift, self.quiet = (
            slices[name] for name in ("normalized", "drift", "quiet")
        )
        self.watch, self.faults, self.ratios, self.resets = (
            slices[name] for name in ("watch", "faults", "ratios", "resets")
        )
        self.time, self.q = slices["time"].start, slices["q"]
        self.health = estimate["health"].start
        self.contacts, self.changes = slices["counts"].start, slices["counts"].start + 1
        self.end = slices["counts"].stop
        self.contact, self.event = slices["contact"].stop, slices["event"].stop


@dataclass(frozen=True, eq=False, repr=False)
class Result(Value):
    """What one sample brought; worked out when it is asked for.

    Attributes:
        time: of the sample [s].
        q: (n,) its joint positions [rad or m].
        estimate: torques and wrenches.
        contacts: at least one per segment that is touched.
        detection: levels per segment.
        health: health bits of the sample (`touchline.Health`).
        events: those that began, changed or ended with this sample.
        watch: of each segment: can a touch of it be felt?
        faults: channels that are not believed.
        ratios: (channels,) of each one's last step over what is believed at once, in the order
            q, qd, tau of all joints, six axes of each sensor.
        resets: of each joint, then of each segment: how often its estimate has begun anew so far,
            and the jump that the last time made.
    """

    time: float
    q: Array
    estimate: Estimate
    contacts: list[Contact]
    detection: Detection
    health: int
    events: tuple[EventChange, ...] = ()
    watch: tuple[Watch, ...] = ()
    faults: tuple[ChannelFault, ...] = ()
    ratios: Array = field(default_factory=lambda: np.empty(0))
    resets: tuple[Reset, ...] = ()

    def _told(self) -> dict[str, Any]:
        """Without what stands behind contacts and faults, and estimates that go on undisturbed."""
        told = super()._told()
        del told["detection"], told["ratios"]
        told["resets"] = tuple(reset for reset in self.resets if reset.count)
        return told if told["resets"] else {k: x for k, x in told.items() if k != "resets"}


def _time(row: Array, at: Layout) -> float:
    return row.item(at.time)


def _q(row: Array, at: Layout) -> Array:
    return row[at.q]


def _estimate(row: Array, at: Layout) -> Estimate:
    return Estimate(row[at.row], at.estimate)


def _contacts(row: Array, at: Layout) -> list[Contact]:
    return [
        Contact.of(row[begin : begin + at.contact], at.names)
        for begin in range(at.end, _end_of_contacts(row, at), at.contact)
    ]


def _end_of_contacts(row: Array, at: Layout) -> int:
    return at.end + at.contact * int(row.item(at.contacts))


def _detection(row: Array, at: Layout) -> Detection:
    return Detection(row[at.levels], row[at.normalized], row[at.drift], row[at.quiet])


def _health(row: Array, at: Layout) -> int:
    return int(row.item(at.health))


def _events(row: Array, at: Layout) -> tuple[EventChange, ...]:
    begin, width = _end_of_contacts(row, at), at.event + 1
    return tuple(
        EventChange(HAPPENED[int(row.item(i))], Event.of(row[i + 1 : i + width], at.names))
        for i in range(begin, begin + width * int(row.item(at.changes)), width)
    )


def _watch(row: Array, at: Layout) -> tuple[Watch, ...]:
    return tuple(WATCH[int(state)] for state in row[at.watch].tolist())


def _faults(row: Array, at: Layout) -> tuple[ChannelFault, ...]:
    return faults_of(row[at.faults], row[at.ratios], at.channels)


def _ratios(row: Array, at: Layout) -> Array:
    return row[at.ratios]


def _resets(row: Array, at: Layout) -> tuple[Reset, ...]:
    return resets_of(row[at.resets], at.estimates)


lazily(
    Result,
    {
        "faults": _faults,
        "ratios": _ratios,
        "resets": _resets,
        "watch": _watch,
        "time": _time,
        "q": _q,
        "estimate": _estimate,
        "contacts": _contacts,
        "detection": _detection,
        "health": _health,
        "events": _events,
    },
)
