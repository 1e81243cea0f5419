# SPDX-License-Identifier: Apache-2.0
"""Touches that are weaker than what is surely felt where they are."""

from collections.abc import Mapping, Sequence

from touchline.check.felt import Felt
from touchline.report.comparison import Comparison
from touchline.result.event import Event

MOST = 20  # lines


def faint_lines(
    events: Sequence[Event], comparisons: Sequence[Comparison], felt: Mapping[str, Felt]
) -> list[str]:
    """A line for each touch, true or felt, that lies below what can be felt on its link.

    An event is judged by its largest force, if its link and force are known; a true contact by its
    own.

    Args:
        events: of a recording.
        comparisons: with the true contacts of a simulated one.
        felt: what can be felt on each link, of `touchline.check.felt`.
    """
    lines = []
    for row in comparisons:
        truth = row.truth
        found = "not felt" if row.event is None else f"felt as event {row.event.id}"
        lines += _line(
            f"true touch at {truth.time[0]:.2f} s ({found})", truth.strength, felt.get(truth.link)
        )
    for event in events:
        if event.link is not None and event.force_peak is not None:
            lines += _line(f"event {event.id}", event.force_peak, felt.get(event.link))
    more = len(lines) - MOST
    return [*lines[:MOST], *([f"{more} more touches are as faint"] if more > 0 else [])]


def _line(touch: str, force: float, felt: Felt | None) -> list[str]:
    told = None if felt is None else felt.faint(touch, force)
    return [] if told is None else [told]
