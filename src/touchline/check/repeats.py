# SPDX-License-Identifier: Apache-2.0
"""Rows that hold the numbers of the row before under a later stamp: a state that was read twice.

A joint at rest and a coarse signal repeat their values too. So a row counts only where at least
four signals of a group change right before and right after, and none of the group between. How
often that is chance follows from how often each signal rests while the others change.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Mask
from touchline.check.findings import Findings
from touchline.check.signals import signals_of
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

CHANGE = 4  # signals of a group that change before and after; fewer may rest by chance
LONGEST = 10  # rows in a row; what holds its value for longer is judged as stuck or at rest
FEW = 0.005  # of the rows
CHANCE = 5.0  # times as many as signals would make that rest independently of each other
KINDS = {"q": "positions", "qd": "velocities", "tau": "torques"}


@dataclass
class _Group:
    """What one group of signals has shown.

    Attributes:
        name: of the group.
        columns: of all signals.
        repeated: rows that hold the numbers of the one before.
        steps: between rows in which any signal of the group changes.
        rested: (C,) those of them in which a signal did not change.
    """

    name: str
    columns: Mask
    repeated: int
    steps: int
    rested: Array

    @property
    def chance(self) -> float:
        """The share of rows that would repeat if signals rested independently of each other."""
        return float(np.prod(self.rested / max(self.steps, 1)))


class Repeats:
    """Counts the rows in which each group of signals repeats the row before.

    Args:
        robot: whose signals they are.
    """

    def __init__(self, robot: Robot) -> None:
        signals = signals_of(robot)
        self._at = [(s.kind, (slice(None), *s.index)) for s in signals]
        own = [s.name.rpartition(".")[0] if s.kind == "wrench" else KINDS[s.kind] for s in signals]
        masks = {name: np.array([x == name for x in own]) for name in dict.fromkeys(own)}
        self._groups = [_Group(n, m, 0, 0, np.zeros(m.sum())) for n, m in masks.items()]
        self._rows = np.empty((0, len(signals)))
        self._time = np.empty(0)
        self.samples = 0

    def add(self, part: Samples) -> None:
        """Take N samples."""
        self.samples += len(part)
        rows = np.column_stack([getattr(part, kind)[at] for kind, at in self._at])
        self._rows = np.concatenate([self._rows, rows])
        self._time = np.concatenate([self._time, part.time])
        if not len(self._rows):
            return
        with np.errstate(invalid="ignore"):
            later = np.diff(self._time) > 0
            changed = (np.diff(self._rows, axis=0) != 0) & np.isfinite(self._rows[1:])
        for group in self._groups:
            _count(group, changed[later][:, group.columns])
        self._rows, self._time = self._rows[-1:], self._time[-1:]

    def report(self, findings: Findings) -> None:
        """Say which groups repeat rows, and what that does."""
        told = [g for g in self._groups if g.repeated > max(FEW, CHANCE * g.chance) * self.samples]
        if not told:
            return
        shares = [f"{g.name} in {100 * g.repeated / self.samples:.1f} %" for g in told]
        findings.note(
            "time stamps",
            "  rows repeat the numbers of the row before under a later stamp "
            f"({', '.join(shares)}): read again before they were new. They tell nothing, and noise "
            "and velocities that follow from them are wrong",
        )


def _count(group: _Group, changed: Mask) -> None:
    """Count repeats in steps (M, C) between rows, each with what changed."""
    many = changed.sum(axis=1) >= CHANGE
    still = changed.sum(axis=1) == 0
    group.steps += int((~still).sum())
    group.rested += (~changed[~still]).sum(axis=0)
    edges = np.flatnonzero(np.diff(still, prepend=False, append=False))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        inside = 0 < first and end < len(still) and end - first <= LONGEST
        if inside and many[first - 1] and many[end]:
            group.repeated += int(end - first)
