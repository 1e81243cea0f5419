# SPDX-License-Identifier: Apache-2.0
"""How much of a robot the data can tell: chosen by cross-validation over blocks of time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index, Mask
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
from touchline.identify.payload import SETTLED, SIGMA, guess_payload, seen_leaves
from touchline.identify.regressor import PARAMETERS
from touchline.identify.touches import usual_scatter

FOLDS = 5  # parts of each recording, one after the other
BLOCK = 1.0  # s; residuals farther apart are taken as independent
MOVED = 0.01  # rad/s RMS; a slower joint shows no friction
SIGMAS = (0.01, 0.03, 0.1, 0.3)  # of inertias about the model's, from hardly free to free
CORRELATED = 0.2  # equations closer than the filter's memory repeat each other
HUBER = 3.0  # usual sigmas beyond which an equation loses weight
LEAST_SCATTER = 0.002  # of the row's largest reading: no model foretells more closely than this
POSES = 0.1  # rad; joints that all moved less show one pose, which tells no inertia
MANY = 5.0  # times a bias is less sure beside masses: then it may be one
OFFSET, OFFSET_SHARE = 0.1, 0.003  # N or Nm, or of the row's largest reading: less matters little
BETTER = 1.0  # standard errors by which a larger model must win
SAME = 1.0 + 1e-9  # costs closer than that differ by rounding, as where friction is held at zero


@dataclass(frozen=True)
class Fold:
    """Instants to fit on and instants to judge on."""

    train: Mask
    test: Mask


def folds_of(evidence: Evidence, use: Mask, count: int = FOLDS) -> Iterator[Fold]:
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


def blocks_of(evidence: Evidence) -> Index:
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

    def __init__(self, evidence: Evidence, use: Mask) -> None:
        self.evidence, self.use = evidence, use
        self.start = evidence.residual()
        self.floor = LEAST_SCATTER * np.abs(evidence.reading).max(axis=0, initial=0.0)
        self.folds = list(folds_of(evidence, use))
        self.blocks = blocks_of(evidence)
        self.moved = np.sqrt(np.mean(evidence.qd[use] ** 2, axis=0)) > MOVED
        self.links = main_links(evidence.robot)
        self.nodes = self._seen()
        self.weight = self._weight(self.start)
        self.rich = self._richest(self.start)
        for _ in range(2):
            found = self.fit(self.richest())
            left = self.start + applied(evidence, found)
            self.weight = self._weight(left)
        self.scale = self._scatter(left)
        bodies = Solution(replace(found.problem, columns=()), np.empty(0), found.steps)
        if found.problem.bodies:
            self.rich = self._richest(self.start + applied(evidence, bodies))

    def richest(self, sigma: float = 0.1) -> Problem:
        """Every column that any row may have, and inertias that may leave the model's somewhat."""
        return Problem(self.rich, self._bodies(sigma))

    def loaded(self) -> Problem:
        """The richest problem, with payloads that the model lacks."""
        return Problem(self.rich, self._guessed() + self._bodies(0.1))

    def choose(self) -> Problem:
        """Columns of every row, then bodies, then the columns once more beside these."""
        parts = [self._equations(self.richest(), fold.test) for fold in self.folds]
        columns = self._columns_of_rows(self.start)
        loads = self._choose_loads(parts, columns)
        if loads:
            columns = self._beside(loads)
        bodies = loads + self._choose_bodies(parts, columns, loads)
        if bodies:
            columns = self._beside(bodies)
        return Problem(columns, bodies)

    def fit_beside(self, more: tuple[Column, ...]) -> Solution:
        """Further columns beside a payload and somewhat free inertias, with standard errors."""
        problem = self.loaded()
        return self.with_errors(self.fit(replace(problem, columns=(*problem.columns, *more))))

    def ambiguous(self) -> dict[int, float]:
        """Rows whose bias a mass could be as well, with 1 sigma of the bias then."""
        equations = self._equations(self.loaded(), self.use)
        J, prior = equations.jacobian_at_start(), equations.whole_prior()
        H = J.T @ equations.normal @ J + np.diag(prior)
        linear = len(equations.problem.columns)
        beside = np.sqrt(np.diag(np.linalg.pinv(H))[:linear])
        alone = np.sqrt(np.diag(np.linalg.pinv(H[:linear, :linear])))
        largest = np.abs(self.evidence.reading).max(axis=0, initial=0.0)
        return {
            c.row: float(sigma)
            for c, sigma, own in zip(equations.problem.columns, beside, alone, strict=True)
            if c.kind == "bias" and sigma > max(MANY * own, OFFSET, OFFSET_SHARE * largest[c.row])
        }

    def choose_beside(self, options: Sequence[tuple[Column, ...]]) -> Solution:
        """Which further columns foretell most beside a payload and inertias as free as it takes.

        Args:
            options: the simpler ones first, the last one with all columns of the others.

        Returns:
            The solution, with standard errors.
        """
        loads = self._guessed()
        rich = Problem((*self.rich, *options[-1]), self._bodies(0.1))
        parts = [self._equations(rich, fold.test) for fold in self.folds]
        problems, costs = [], []
        for option in options:
            tried = [Problem((*self.rich, *option), loads + self._bodies(x)) for x in SIGMAS]
            told = [self._foretold(parts, problem) for problem in tried]
            best = int(np.argmin([cost.mean() for cost in told]))
            problems.append(tried[best])
            costs.append(told[best])
        return self.with_errors(self.fit(problems[self._simplest(costs)]))

    def _guessed(self) -> tuple[BodyChange, ...]:
        """First guesses at payloads that the model lacks."""
        whole = self._equations(self.richest(), self.use)
        nodes = [node for node in seen_leaves(self.evidence) if node in self.nodes]
        guesses = [guess_payload(whole, node) for node in nodes]
        return tuple(guess for guess in guesses if guess is not None)

    def _beside(self, bodies: tuple[BodyChange, ...]) -> tuple[Column, ...]:
        """Columns of the rows beside bodies, which are fitted with all columns first."""
        found = self.fit(Problem(self.rich, bodies))
        only = Solution(Problem((), bodies), np.empty(0), found.steps)
        return self._columns_of_rows(self.start + applied(self.evidence, only))

    def fit(self, problem: Problem, use: Mask | None = None) -> Solution:
        """Fits a problem; equations that are far off count less."""
        return self._equations(problem, self.use if use is None else use).solve()

    def with_errors(self, found: Solution) -> Solution:
        """The solution with standard errors.

        Those of a payload count that links may be off, although it was settled beside links as
        modelled: without a sensor near it, a payload is known no better than the links are.
        """
        left = self.start + applied(self.evidence, found)
        told, bodies = self._errors(found, left), found.problem.bodies
        loads = tuple(replace(body, sigma=SIGMA) for body in bodies if body.added)
        if not loads:
            return told
        links = bodies[len(loads) :] or self._bodies(SIGMAS[0])
        steps = np.zeros((len(loads) + len(links), PARAMETERS))
        steps[: len(bodies)] = found.steps
        beside = Solution(Problem(found.problem.columns, loads + links), found.values, steps)
        errors = told.body_errors.copy()
        errors[: len(loads)] = self._errors(beside, left).body_errors[: len(loads)]
        return replace(told, body_errors=errors)

    def _errors(self, found: Solution, left: Array) -> Solution:
        equations = self._equations(found.problem, self.use)
        return equations.with_errors(found, left, self.weight, self.use, self.blocks)

    def _equations(self, problem: Problem, use: Mask) -> Equations:
        return Equations.of(self.evidence, problem, self.start, self.weight, use)

    def _scatter(self, left: Array) -> Array:
        return np.maximum(usual_scatter(left[self.use], self.evidence.used), self.floor)

    def _weight(self, left: Array) -> Array:
        """One over variance (N, R), less for what is far off (Huber)."""
        scale = self._scatter(left)
        far = np.abs(left) / scale
        return CORRELATED / scale**2 * np.minimum(1.0, HUBER / np.maximum(far, 1e-12))

    def _seen(self) -> list[int]:
        """Nodes whose inertia some row feels; none in one pose, which tells no inertia."""
        model, used = self.evidence.model, self.evidence.used
        if np.ptp(self.evidence.q[self.use], axis=0).max(initial=0.0) < POSES:
            return []
        return [i for i in self.links if np.abs(model[:, used, i]).max(initial=0.0) > 0]

    def _bodies(self, sigma: float) -> tuple[BodyChange, ...]:
        return tuple(BodyChange(i, self.links[i][1], sigma) for i in self.nodes)

    def _rows(self) -> list[int]:
        return np.flatnonzero(self.evidence.used).tolist()

    def _cost(self, left: Array, row: int | None = None) -> Array:
        """(blocks,) mean of squares in units of the usual scatter, far ones tamed."""
        rows = slice(None) if row is None else [row]
        size = np.minimum(np.abs(left[:, rows]) / self.scale[rows], 10.0 * HUBER) ** 2
        numbers, at = np.unique(self.blocks[self.use], return_inverse=True)
        total = np.zeros(len(numbers))
        np.add.at(total, at, size[self.use].sum(axis=1))
        return total / np.bincount(at)

    def _simplest(self, costs: list[Array]) -> int:
        """The first of the options, the simpler ones first, that is as good as the best."""
        means = np.array([cost.mean() for cost in costs])
        best = int(np.argmax(means <= SAME * means.min()))
        for i, cost in enumerate(costs[:best]):
            gain = cost - costs[best]
            if gain.mean() <= BETTER * gain.std() / np.sqrt(len(gain)):
                return i
        return best

    def _columns_of_rows(self, start: Array) -> tuple[Column, ...]:
        """For every row the columns that foretell it best, the bodies being as they are."""
        chosen: list[Column] = []
        for r in self._rows():
            rich = [c for c in self.rich if c.row == r]
            options = _options(rich)
            left = [np.zeros(start.shape) for _ in options]
            for fold in self.folds:
                for i, option in enumerate(options):
                    left[i][fold.test, r] = self._row_left(start, r, option, fold.train, fold.test)
            chosen += options[self._simplest([self._cost(x, r) for x in left])]
        return tuple(chosen)

    def _choose_loads(
        self, parts: list[Equations], columns: tuple[Column, ...]
    ) -> tuple[BodyChange, ...]:
        """Payloads that the model lacks, as far as they foretell something."""
        whole, loads = _sum(parts), ()
        for node in seen_leaves(self.evidence):
            if node not in self.nodes:
                continue
            guess = guess_payload(whole.only(Problem(self.rich, whole.problem.bodies)), node)
            if guess is None:
                continue
            options = [loads, (*loads, guess)]
            costs = [self._foretold(parts, Problem(columns, option)) for option in options]
            loads = options[self._simplest(costs)]
        return self._settled(loads) if loads else ()

    def _settled(self, loads: tuple[BodyChange, ...]) -> tuple[BodyChange, ...]:
        """Payloads as the model's links let them be: what these may explain comes after them."""
        found = self.fit(Problem(self.rich, loads))
        pairs = zip(loads, found.changes(), strict=True)
        return tuple(replace(load, model=change, sigma=SETTLED) for load, change in pairs)

    def _choose_bodies(
        self, parts: list[Equations], columns: tuple[Column, ...], loads: tuple[BodyChange, ...]
    ) -> tuple[BodyChange, ...]:
        """How freely inertias may leave the model's; none if that foretells nothing better."""
        if not self.nodes:
            return ()
        options = [(), *(self._bodies(sigma) for sigma in SIGMAS)]
        costs = [self._foretold(parts, Problem(columns, loads + option)) for option in options]
        return options[self._simplest(costs)]

    def _foretold(self, parts: list[Equations], problem: Problem) -> Array:
        """Cost (blocks,) on instants that a fit to the other parts of time has not seen."""
        left = np.zeros(self.start.shape)
        for k, fold in enumerate(self.folds):
            train = _sum([part for i, part in enumerate(parts) if i != k])
            found = train.only(problem).solve()
            left[fold.test] = (self.start + applied(self.evidence, found))[fold.test]
        return self._cost(left)

    def _row_left(
        self, start: Array, r: int, columns: list[Column], train: NDArray, test: NDArray
    ) -> Array:
        """What is left of a row where its own columns alone are fitted to other instants."""
        if not columns:
            return start[test, r]
        problem = Problem(tuple(columns))
        only = replace(self.evidence, used=np.arange(len(self.evidence.used)) == r)
        values = Equations.of(only, problem, start, self.weight, train).solve().values
        added = sum(v * column_of(only, c, r) for v, c in zip(values, columns, strict=True))
        return (start[:, r] + added)[test]

    def _richest(self, start: Array) -> tuple[Column, ...]:
        """All columns that rows may have, with the width of Coulomb friction that fits best."""
        columns: list[Column] = []
        joints = self.evidence.robot.description.joints
        for r in self._rows():
            own = [Column("bias", r)]
            if r < len(joints) and self.moved[r]:
                own.append(Column("viscous", r))
                if joints[r].torque == "motor":
                    own.append(Column("rotor", r))
                own.append(self._best_coulomb(start, r, own))
            columns += own
        return tuple(columns)

    def _best_coulomb(self, start: Array, r: int, beside: list[Column]) -> Column:
        law = self.evidence.robot.description.joints[r].friction
        widths = WIDTHS if law.coulomb == 0.0 else (law.coulomb_width,)
        options = [Column("coulomb", r, width) for width in widths]
        costs = []
        for option in options:
            left = self._row_left(start, r, [*beside, option], self.use, self.use)
            costs.append(float((self.weight[self.use, r] * left**2).sum()))
        return next(o for o, c in zip(options, costs, strict=True) if c <= SAME * min(costs))


def _options(rich: list[Column]) -> list[list[Column]]:
    """Sets of columns that a row may have, simpler ones first."""
    kinds = [
        (),
        ("bias",),
        ("bias", "coulomb"),
        ("bias", "viscous"),
        ("bias", "coulomb", "viscous"),
        ("bias", "coulomb", "viscous", "rotor"),
    ]
    sets = [tuple(c for c in rich if c.kind in of) for of in kinds]
    return [list(option) for option in dict.fromkeys(sets)]


def _sum(parts: list[Equations]) -> Equations:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
