# SPDX-License-Identifier: Apache-2.0
"""How much of a robot the data can tell: chosen by cross-validation over blocks of time."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.identify.evidence import WIDTHS, Evidence
from touchline.identify.fit import (
    BodyChange,
    Column,
    Equations,
    Problem,
    Solution,
    applied,
    column_of,
    main_links,
)
from touchline.identify.touches import usual_scatter

Array = NDArray[np.float64]

FOLDS = 5  # parts of each recording, one after the other
BLOCK = 1.0  # s; residuals farther apart are taken as independent
MOVED = 0.01  # rad/s RMS; a slower joint shows no friction
SIGMAS = (0.01, 0.03, 0.1, 0.3)  # of inertias about the model's, from hardly free to free
CORRELATED = 0.2  # equations closer than the filter's memory repeat each other
HUBER = 3.0  # usual sigmas beyond which an equation loses weight
LEAST_SCATTER = 0.002  # of the row's largest reading: no model foretells more closely than this
POSES = 0.1  # rad; joints that all moved less show one pose, which tells no inertia
BETTER = 1.0  # standard errors by which a larger model must win


@dataclass(frozen=True)
class Fold:
    """Instants to fit on and instants to judge on."""

    train: NDArray[np.bool_]
    test: NDArray[np.bool_]


def folds_of(evidence: Evidence, use: NDArray[np.bool_], count: int = FOLDS) -> Iterator[Fold]:
    """Each recording in `count` parts; the k-th parts of all are held out together."""
    part = np.zeros(len(evidence), dtype=int)
    for number in np.unique(evidence.recording):
        own = np.flatnonzero(evidence.recording == number)
        part[own] = np.arange(len(own)) * count // len(own)
    for k in range(count):
        test = use & (part == k)
        train = use & (part != k)
        if test.any() and train.any():
            yield Fold(train, test)


def blocks_of(evidence: Evidence) -> NDArray[np.int64]:
    """The number of the block of time (N,) that each instant belongs to."""
    number = np.floor(evidence.time / BLOCK).astype(np.int64)
    number += evidence.recording * (number.max(initial=0) - number.min(initial=0) + 1)
    return np.unique(number, return_inverse=True)[1]


class Chooser:
    """Adds to a model what the data support, step by step.

    Args:
        evidence: all instants.
        use: (N,) those that may be used.
    """

    def __init__(self, evidence: Evidence, use: NDArray[np.bool_]) -> None:
        self.evidence, self.use = evidence, use
        self.start = evidence.residual()
        self.floor = LEAST_SCATTER * np.abs(evidence.reading).max(axis=0, initial=0.0)
        self.scale = self._scatter(self.start)
        joints = evidence.robot.description.joints
        self.moved = [
            bool(np.sqrt(np.mean(evidence.qd[use, j] ** 2)) > MOVED) for j in range(len(joints))
        ]

    def choose(self) -> Problem:
        """Columns of every row, then bodies, then the columns once more beside these."""
        columns = self._columns_of_rows(Problem())
        self._rescale(Problem(columns))
        bodies = self._bodies(columns)
        if bodies:
            columns = self._columns_of_rows(Problem((), bodies))
        return Problem(columns, bodies)

    def richest(self) -> Problem:
        """Every column that any row may have, and inertias that may leave the model's somewhat."""
        columns = tuple(c for r in self._rows() for c in self._richest(r, self.start))
        links = main_links(self.evidence.robot)
        return Problem(columns, tuple(BodyChange(i, links[i][1], 0.1) for i in self._seen(links)))

    def fit(self, problem: Problem, use: NDArray[np.bool_] | None = None) -> Solution:
        """Fits a problem, equations that are far off with less weight."""
        use = self.use if use is None else use
        part, start = self.evidence.part(use), self.start[use]
        weight = np.broadcast_to(CORRELATED / self.scale**2, start.shape)
        found = Equations(part, problem, start, weight).solve()
        for _ in range(2):
            left = np.abs(start + applied(part, found)) / self.scale
            robust = weight * np.minimum(1.0, HUBER / np.maximum(left, 1e-12))
            found = Equations(part, problem, start, robust).solve()
        return found

    def with_errors(self, found: Solution) -> Solution:
        """The solution with standard errors."""
        part, start = self.evidence.part(self.use), self.start[self.use]
        weight = np.broadcast_to(CORRELATED / self.scale**2, start.shape)
        equations = Equations(part, found.problem, start, weight)
        return equations.with_errors(found, blocks_of(part))

    def _rescale(self, problem: Problem) -> None:
        found = self.fit(problem)
        left = self.start + applied(self.evidence, found)
        self.scale = self._scatter(left)

    def _scatter(self, left: Array) -> Array:
        return np.maximum(usual_scatter(left[self.use], self.evidence.used), self.floor)

    def _held_out(self, problem: Problem) -> Array:
        """Residuals (N, R) of each instant by fits that have not seen it; NaN outside of `use`."""
        left = np.full(self.start.shape, np.nan)
        for fold in folds_of(self.evidence, self.use):
            found = self.fit(problem, fold.train)
            test = self.evidence.part(fold.test)
            left[fold.test] = self.start[fold.test] + applied(test, found)
        return left

    def _cost(self, left: Array) -> Array:
        """(blocks, R) mean of squares in units of the usual scatter, far ones tamed."""
        blocks = blocks_of(self.evidence)
        size = np.minimum(np.abs(left) / self.scale, 10.0 * HUBER) ** 2
        numbers = np.unique(blocks[self.use])
        return np.array([size[self.use & (blocks == b)].mean(axis=0) for b in numbers])

    def _wins(self, larger: Array, smaller: Array) -> bool:
        """Is one cost (blocks,) lower than the other beyond chance?"""
        gain = smaller - larger
        error = float(np.std(gain)) / np.sqrt(max(len(gain), 1))
        return float(np.mean(gain)) > BETTER * error

    def _columns_of_rows(self, beside: Problem) -> tuple[Column, ...]:
        """For every row the columns that foretell it best, others as they are."""
        chosen: list[Column] = []
        base = self.start
        if beside.bodies:
            # The bodies as fitted together with the richest columns stay as they are meanwhile.
            rich = tuple(c for r in self._rows() for c in self._richest(r, base))
            found = self.fit(Problem(rich, beside.bodies))
            only = Solution(Problem((), beside.bodies), np.empty(0), found.steps)
            base = self.start + applied(self.evidence, only)
        kept, self.start = self.start, base
        try:
            for r in self._rows():
                chosen += self._columns_of_row(r)
        finally:
            self.start = kept
        return tuple(chosen)

    def _rows(self) -> list[int]:
        return np.flatnonzero(self.evidence.used).tolist()

    def _columns_of_row(self, r: int) -> list[Column]:
        rich = self._richest(r, self.start)
        options = [[], [Column("bias", r)]]
        if len(rich) > 1:
            options += [[c for c in rich if c.kind != "rotor"], rich]
            motion = [c for c in rich if c.kind in ("coulomb", "viscous")]
            options += [[Column("bias", r), c] for c in motion]
        options = [list(x) for x in dict.fromkeys(tuple(o) for o in options)]
        options.sort(key=len)
        costs = [self._cost(self._held_out_row(r, tuple(o)))[:, r] for o in options]
        best = int(np.argmin([c.mean() for c in costs]))
        for option, cost in zip(options, costs, strict=True):
            if not self._wins(costs[best], cost):
                return option
        return options[best]

    def _held_out_row(self, r: int, columns: tuple[Column, ...]) -> Array:
        left = np.full(self.start.shape, np.nan)
        for fold in folds_of(self.evidence, self.use):
            left[fold.test, r] = self._row_fit(r, columns, fold.train, fold.test)
        return left

    def _row_fit(self, r: int, columns: tuple[Column, ...], train: NDArray, test: NDArray) -> Array:
        """What is left of one row where its own columns alone are fitted."""
        if not columns:
            return self.start[test, r]
        only = replace(self.evidence, used=np.arange(len(self.evidence.used)) == r)
        part, start = only.part(train), self.start[train]
        weight = np.zeros(start.shape)
        weight[:, r] = CORRELATED / self.scale[r] ** 2
        values = np.zeros(len(columns))
        for _ in range(3):
            values = Equations(part, Problem(columns), start, weight).solve().values
            rest = start[:, r] + _sum(part, columns, values)
            far = np.abs(rest) / self.scale[r]
            weight[:, r] = CORRELATED / self.scale[r] ** 2 * np.minimum(1.0, HUBER / (far + 1e-12))
        return self.start[test, r] + _sum(only.part(test), columns, values)

    def _richest(self, r: int, start: Array) -> list[Column]:
        """All that a row may have, with the width of Coulomb friction that fits best."""
        columns = [Column("bias", r)]
        if r >= self.evidence.joints or not self.moved[r]:
            return columns
        columns.append(Column("viscous", r))
        if self.evidence.robot.description.joints[r].torque == "motor":
            columns.append(Column("rotor", r))
        kept, self.start = self.start, start
        own = self.evidence.robot.description.joints[r].friction
        widths = WIDTHS if own.coulomb == 0.0 else (own.coulomb_width,)
        costs = []
        for width in widths:
            tried = (*columns, Column("coulomb", r, width))
            left = self._row_fit(r, tried, self.use, self.use)
            costs.append(float(np.mean(np.minimum(np.abs(left) / self.scale[r], 30.0) ** 2)))
        self.start = kept
        columns.append(Column("coulomb", r, widths[int(np.argmin(costs))]))
        return columns

    def _bodies(self, columns: tuple[Column, ...]) -> tuple[BodyChange, ...]:
        """How freely inertias may leave the model's; none if that foretells nothing better."""
        links = main_links(self.evidence.robot)
        seen = self._seen(links)
        if not seen:
            return ()
        options: list[tuple[BodyChange, ...]] = [()]
        options += [tuple(BodyChange(i, links[i][1], s) for i in seen) for s in SIGMAS]
        costs = [self._cost(self._held_out(Problem(columns, o))).sum(axis=1) for o in options]
        best = int(np.argmin([c.mean() for c in costs]))
        for option, cost in zip(options, costs, strict=True):
            if not self._wins(costs[best], cost):
                return option
        return options[best]

    def _seen(self, links: dict[int, tuple[str, Array]]) -> list[int]:
        """Nodes that some row carries."""
        model, used = self.evidence.model, self.evidence.used
        if np.ptp(self.evidence.q[self.use], axis=0).max(initial=0.0) < POSES:
            return []
        return [i for i in links if np.abs(model[:, used, i]).max(initial=0.0) > 0]


def _sum(part: Evidence, columns: tuple[Column, ...], values: Array) -> Array:
    total = np.zeros(len(part))
    for column, value in zip(columns, values, strict=True):
        total += value * column_of(part, column)
    return total
