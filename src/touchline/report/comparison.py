# SPDX-License-Identifier: Apache-2.0
"""Events beside the truth of a simulated log: which contact was meant, and how far off it is."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchline.contact.event import Event

Array = NDArray[np.float64]
MATCH = 0.3  # s; a test may fire this long after the contact began


@dataclass(frozen=True)
class TrueContact:
    """One contact of the truth, from beginning to end.

    Attributes:
        link: that is touched.
        time: (N,) [s]; `point` (N, 3) [m] and `force` (N, 3) [N], world.
    """

    link: str
    time: Array
    point: Array
    force: Array

    @property
    def strength(self) -> float:
        """Largest force [N]."""
        return float(np.linalg.norm(self.force, axis=1).max())

    @property
    def mean_force(self) -> Array:
        """Force (3,) [N], mean over the samples near the peak."""
        norms = np.linalg.norm(self.force, axis=1)
        return self.force[norms >= 0.9 * norms.max()].mean(axis=0)

    def point_at(self, time: float) -> Array:
        """Point (3,) [m] at a time [s] of the contact."""
        return self.point[min(int(np.searchsorted(self.time, time)), len(self.time) - 1)]


@dataclass(frozen=True)
class Comparison:
    """A true contact and the event that found it, or None.

    `position_error` [m] is at the event's `time_of_position`; `force_error` [N] is that of the
    event's force against the truth while it was strong. NaN where there is nothing to compare.
    """

    truth: TrueContact
    event: Event | None
    position_error: float
    force_error: float


def read_truth(log: Path) -> list[TrueContact]:
    """The true contacts of a simulated Parquet log, in the order of their beginning.

    Empty for a log without truth, as those of real robots are.
    """
    import json

    import pyarrow.parquet as pq

    if log.suffix != ".parquet":
        return []
    schema = pq.read_schema(log)
    columns = [name for name in schema.names if name.startswith("truth.contact.")]
    if not columns:
        return []
    table = pq.read_table(log, columns=["time", *columns])
    data = {name: np.asarray(table.column(name)) for name in table.column_names}
    links: list[str] = next(
        value["truth.links"]
        for value in map(json.loads, (schema.metadata or {}).values())
        if isinstance(value, dict) and "truth.links" in value
    )
    slots = sorted({int(name.split(".")[2]) for name in columns})
    contacts = [contact for slot in slots for contact in _contacts(data, slot, links)]
    return sorted(contacts, key=lambda contact: contact.time[0])


def _contacts(data: dict[str, Array], slot: int, links: Sequence[str]) -> list[TrueContact]:
    prefix = f"truth.contact.{slot}"
    link = np.nan_to_num(data[f"{prefix}.link"], nan=-1.0).astype(int)
    edges = np.flatnonzero(np.diff(link, prepend=-1, append=-1))
    found = []
    for start, stop in zip(edges[:-1], edges[1:], strict=True):
        if link[start] >= 0:
            part = slice(start, stop)
            point = np.stack([data[f"{prefix}.{axis}"][part] for axis in "xyz"], axis=1)
            force = np.stack([data[f"{prefix}.f{axis}"][part] for axis in "xyz"], axis=1)
            found.append(TrueContact(links[int(link[start])], data["time"][part], point, force))
    return found


def compare_log(events: Sequence[Event], log: Path) -> list[Comparison]:
    """The events of a log beside its truth; empty for a log without."""
    return compare(events, read_truth(log))


def compare(events: Sequence[Event], truth: Sequence[TrueContact]) -> list[Comparison]:
    """Finds for each true contact the event nearest to it among those of its time."""
    left = list(events)
    comparisons = []
    for contact in truth:
        begin, end = contact.time[0], contact.time[-1]
        near = [e for e in left if begin <= e.detected <= min(end, begin + MATCH)]
        event = min(near, key=lambda e: _mismatch(contact, e), default=None)
        if event is not None:
            left.remove(event)
        comparisons.append(_comparison(contact, event))
    return comparisons


def _mismatch(contact: TrueContact, event: Event) -> float:
    """Distance of forces relative to the truth, the measure by which contacts are told apart."""
    if event.force is None:
        return np.inf
    return float(np.linalg.norm(event.force - contact.mean_force)) / contact.strength


def _comparison(contact: TrueContact, event: Event | None) -> Comparison:
    position_error = force_error = np.nan
    if event is not None and event.position is not None and event.time_of_position is not None:
        point = contact.point_at(event.time_of_position)
        position_error = float(np.linalg.norm(event.position - point))
    if event is not None and event.force is not None:
        force_error = float(np.linalg.norm(event.force - contact.mean_force))
    return Comparison(contact, event, position_error, force_error)


def comparison_text(rows: Sequence[Comparison], events: Sequence[Event]) -> str:
    """The table of errors for a terminal."""
    lines = ["   ".join(f"{cell:>9}" for cell in HEAD)]
    lines += ["   ".join(f"{cell:>9}" for cell in cells(row)) for row in rows]
    return "\n".join([*lines, verdict(rows, events)])


HEAD = ("begins", "touched", "force", "felt on", "after", "point off", "force off", "status")


def cells(row: Comparison) -> list[str]:
    """One line of the table, units included."""
    truth, event = row.truth, row.event
    start = [f"{truth.time[0]:.2f} s", truth.link, f"{truth.strength:.1f} N"]
    if event is None:
        return [*start, "not felt", "", "", "", ""]
    delay = 1e3 * (event.detected - truth.time[0])
    point = "-" if np.isnan(row.position_error) else f"{1e3 * row.position_error:.2f} mm"
    force = "-" if np.isnan(row.force_error) else f"{row.force_error:.2f} N"
    status = event.status.replace("_", " ")
    return [*start, event.link or event.segment, f"{delay:.0f} ms", point, force, status]


def verdict(rows: Sequence[Comparison], events: Sequence[Event]) -> str:
    """How many true contacts were found, and how many events belong to none."""
    found = sum(row.event is not None for row in rows)
    return f"{found} of {len(rows)} contacts felt, {len(events) - found} events without a contact"
