# SPDX-License-Identifier: Apache-2.0
"""Resets of estimates: one begins anew, and jumps."""

from collections.abc import Sequence
from dataclasses import dataclass

from touchline.arrays import Array


@dataclass(frozen=True)
class Reset:
    """How often an estimate has begun anew since it first was known.

    It does so after a gap that is too long, and once a channel that was out is back. It also does
    so where others step in for a lost sensor or stand back, and after a reset, a tare or another
    load. Otherwise no estimate moves in a sample by more than its filter does. Who follows one adds
    up the jumps and takes them off. After a gap or a reset the estimate begins at 0 and is itself
    again 5 / bandwidth later.

    Attributes:
        name: of the joint or segment.
        count: of times so far.
        jump: what the last time has changed the estimate by, from the last known value to that of
            the first sample after it. Of a joint one number, its `tau_ext` [Nm]; of a segment six,
            its `segment_wrench` [N, Nm]. Zeros before the first time.
    """

    name: str
    count: int
    jump: tuple[float, ...]


@dataclass(frozen=True)
class ResetChange(Reset):
    """An estimate has begun anew.

    Attributes:
        sample: number of the sample in its recording, or in the part given to `Pipeline.run`.
    """

    sample: int


def estimate_names(joints: Sequence[str], segments: Sequence[str]) -> tuple[tuple[str, int], ...]:
    """Names of all estimates, in the order of the core, each with the numbers that it has."""
    return tuple([*((name, 1) for name in joints), *((name, 6) for name in segments)])


def resets_of(numbers: Array, names: Sequence[tuple[str, int]]) -> tuple[Reset, ...]:
    """Of all estimates, from seven numbers each of the core: count, jump.

    Args:
        numbers: (7 estimates,).
        names: of each, and how many numbers its jump has.
    """
    rows = numbers.reshape(-1, 7).tolist()
    return tuple(
        Reset(name, int(row[0]), tuple(row[1 : 1 + size]))
        for (name, size), row in zip(names, rows, strict=True)
    )


def resets_in(rows: Array, names: Sequence[tuple[str, int]]) -> tuple[ResetChange, ...]:
    """From rows (N, 9) of the core: sample, estimate, count, jump."""
    changes = []
    for row in rows.tolist():
        name, size = names[int(row[1])]
        changes.append(ResetChange(name, int(row[2]), tuple(row[3 : 3 + size]), int(row[0])))
    return tuple(changes)
