# SPDX-License-Identifier: Apache-2.0
"""Bars that overlap in time, one below the other."""

from collections.abc import Sequence


def lanes(spans: Sequence[tuple[str, float, float]]) -> list[tuple[int, int]]:
    """The lane of each bar within its row, and how many lanes that row needs.

    Args:
        spans: row, beginning and end of each bar, in the order of their beginning.
    """
    free: dict[str, list[float]] = {}  # row -> when each of its lanes is free
    found = []
    for row, begin, end in spans:
        until = free.setdefault(row, [])
        lane = next((i for i, time in enumerate(until) if time <= begin), len(until))
        until[lane : lane + 1] = [end]
        found.append((row, lane))
    return [(lane, len(free[row])) for row, lane in found]
