# SPDX-License-Identifier: Apache-2.0
"""Events beside the truth of a simulated log: which contact was meant, and how far off it is."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.logs.truth import TrueContact, read_truth
from touchline.result.event import Event

MATCH = 0.3  # s; a test may fire this long after the contact began


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


def compare_log(events: Sequence[Event], log: Path) -> list[Comparison]:
    """The events of a log beside its truth; empty for a log without."""
    return compare(events, read_truth(log))


def compare(events: Sequence[Event], truth: Sequence[TrueContact]) -> list[Comparison]:
    """Finds for each true contact the event nearest to it among those of its time.

    The nearest pairs are found first, so that no contact takes the event of another.
    """
    pairs = [
        (_mismatch(contact, event), row, event)
        for row, contact in enumerate(truth)
        for event in events
        if contact.time[0] <= event.detected <= min(contact.time[-1], contact.time[0] + MATCH)
    ]
    found: dict[int, Event] = {}
    taken: set[int] = set()
    for _, row, event in sorted(pairs, key=lambda pair: pair[0]):
        if row not in found and event.id not in taken:
            found[row] = event
            taken.add(event.id)
    return [_comparison(contact, found.get(row)) for row, contact in enumerate(truth)]


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
