# SPDX-License-Identifier: Apache-2.0
"""Events: from the sample at which a test fires to the one at which the contact is gone."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.result.contact import Candidate, least_contacts
from touchline.result.kinds import ContactLevel, Happened, Status, Zone
from touchline.result.native import EVENT, decoders
from touchline.value import Value, lazily


@dataclass(kw_only=True, eq=False, repr=False)
class Event(Value):
    """One contact from beginning to end, or so far; what is not known is None.

    Attributes:
        id: number, from 0 in the order of detection.
        segment: name of the segment.
        level: "contact" or "collision": how it began, or a blow while it lasted.
        detected: time at which the test fired [s], not the onset.
        cleared: time at which it ended [s]; None while it lasts.
        status: "located", "ambiguous", "not_separable" or "wrench_only", over the whole event.
        link: the link that carries the point, of the rigid `body`.
        body_probability: how likely that body was touched, 0 to 1.
        position: (3,) [m] the touched point in world at `time_of_position`, from strong samples.
        position_link: (3,) [m] the same point in the frame of `link`.
        time_of_position: of the last strong sample that found it there [s].
        position_std: root of the trace of its covariance [m].
        candidates: all explanations, best first, at `time_of_position`.
        joint: the most distal loaded joint; None where no torque tells.
        force: (3,) [N] the force on the robot, world axes, mean of strong samples; None on `root`.
        force_peak: largest force [N]; None on `root`.
        torque_peak: largest external torque [Nm] on `joint`.
        decided: when the level was decided [s]; None while it is a default.
        zone: "structure", "end_effector" or "handle"; None while that is open.
        clamped: whether forces on two sides opposed each other; None where that is not known.
        rate: largest rate of the segment's force [N/s].
        rank: where no equation is left over, the number of independent ones for the `unknowns`.
        widget: the widget of `interface` that was touched; None for none, or if nobody looked.
    """

    id: int
    segment: str
    level: ContactLevel | str
    detected: float
    cleared: float | None = None
    status: Status | str = Status.WRENCH_ONLY
    link: str | None = None
    body: str | None = None
    body_probability: float | None = None
    position: Array | None = None
    position_link: Array | None = None
    time_of_position: float | None = None
    position_std: float | None = None
    candidates: tuple[Candidate, ...] = ()
    joint: str | None = None
    force: Array | None = None
    force_peak: float | None = None
    torque_peak: float | None = None
    decided: float | None = None
    zone: str | None = None
    clamped: bool | None = False
    rate: float | None = None
    rank: int | None = None
    unknowns: int | None = None
    widget: str | None = None

    @property
    def at_least(self) -> int | None:
        """How many pushes explain what is measured, at least, as of a `touchline.Contact`."""
        return least_contacts(self.status, self.unknowns)

    def as_json(self) -> dict[str, Any]:
        """The event as in `events.json`."""
        return {name: _plain(value) for name, value in self._known().items()}

    @staticmethod
    def from_json(known: Mapping[str, Any]) -> "Event":
        """An event of `events.json`."""
        kinds = {field.name: field.kind for field in EVENT}
        return Event(**{name: _read(x, kinds.get(name)) for name, x in known.items()})


# Fields that are not the core's (docs/architecture.md): it knows no widgets, and no result has one;
# who follows a `Touch` beside the pipeline adds it.
ADDED = ("widget",)
lazily(Event, decoders(EVENT, Candidate) | dict.fromkeys(ADDED, lambda row, names: None))


@dataclass(frozen=True, eq=False, repr=False)
class EventChange(Value):
    """What a sample did to an event: it began, changed or ended; and the event from then on."""

    happened: Happened
    event: Event


WORDS = {"level": ContactLevel, "status": Status, "zone": Zone}


def _read(value: Any, kind: str | None) -> Any:
    if kind == "candidates":
        return tuple(Candidate(**{k: _read(x, "vector") for k, x in c.items()}) for c in value)
    if isinstance(value, list):
        return np.array(value, float)
    return value if value is None or kind not in WORDS else WORDS[kind](value)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        return [float(x) for x in value]
    if isinstance(value, tuple):
        return [_plain(part) for part in value]
    if isinstance(value, str):
        return str(value)
    if isinstance(value, Candidate):
        known = {key: _plain(part) for key, part in value._known().items()}
        return known if value.radius else {k: x for k, x in known.items() if k != "radius"}
    return value
