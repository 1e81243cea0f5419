# SPDX-License-Identifier: Apache-2.0
"""How much of a robot the data can tell: chosen by cross-validation over blocks of time."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index, Mask
from touchline.identify.elsewhere import Elsewhere
from touchline.identify.evidence import WIDTHS, Evidence
from touchline.identify.falling import APART, DryFriction, rounded
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
REGIONS = 4  # of the workspace, along each of its two widest directions
BLOCK = 1.0  # s; residuals farther apart are taken as independent
MOVED = 0.01  # rad/s RMS; a slower joint shows no friction
SIGMAS = (0.01, 0.03, 0.1, 0.3)  # of inertias about the model's, from hardly free to free
CORRELATED = 0.2  # equations closer than the filter's memory repeat each other
HUBER = 3.0  # usual sigmas beyond which an equation loses weight
LEAST_SCATTER = 0.002  # of the row's largest reading: no model foretells more closely than this
FINE_SCATTER = 1e-4  # the same where the model does: what a sensor of 13 bits resolves
POSES = 0.1  # rad; joints that all moved less show one pose, which tells no inertia
MANY = 5.0  # times a bias is less sure beside masses: then it may be one
OFFSET, OFFSET_SHARE = 0.1, 0.003  # N or Nm, or of the row's largest reading: less matters little
BETTER = 1.0  # standard errors by which a larger model must win
CLEARLY = 2.0  # standard errors by which a finer law of friction must win
SURE = 5.0  # standard errors that friction must have which falls with speed
POLISHED, LONGEST = 4, 0.2  # steps of widths and speeds, and of their logarithm at most
DRY = "coulomb", "stribeck"
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


def regions_of(evidence: Evidence, use: Mask) -> Iterator[Fold]:
    """Parts of the workspace, each judged by what was seen of the others."""
    centred = evidence.q - evidence.q[use].mean(axis=0)
    directions = np.linalg.svd(centred[use], full_matrices=False)[2][:2]
    for direction in directions:
        along = centred @ direction
        limits = np.quantile(along[use], np.linspace(0.0, 1.0, REGIONS + 1))
        part = np.clip(np.searchsorted(limits, along, "right") - 1, 0, REGIONS - 1)
        for k in range(REGIONS):
            test, train = use & (part == k), use & (part != k)
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
        least: scatter that a row has at least, as a part of its largest reading.
    """

    def __init__(self, evidence: Evidence, use: Mask, least: float = LEAST_SCATTER) -> None:
        self.evidence, self.use = evidence, use
        self.start = evidence.residual()
        self.floor = least * np.abs(evidence.reading).max(axis=0, initial=0.0)
        self.folds = list(folds_of(evidence, use))
        self.blocks = blocks_of(evidence)
        self.moved = np.sqrt(np.mean(evidence.qd[use] ** 2, axis=0)) > MOVED
        self.links = main_links(evidence.robot)
        self.nodes = self._seen()
        self.plain: dict[int, Column] = {}
        self.weight, self.scale = self._weight(self.start), self._scatter(self.start)
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
        every = Problem((*self.rich, *self.plain.values()), self._bodies(0.1))
        parts = [self._equations(every, fold.test) for fold in self.folds]
        columns = self._columns_of_rows(self.start)
        loads = self._choose_loads(parts, columns)
        if loads:
            columns = self._beside(loads)
        bodies = loads + self._choose_bodies(parts, columns, loads)
        if bodies:
            columns = self._beside(bodies)
        unsure = self._unsure(Problem(columns, bodies))
        if unsure:
            self.rich = tuple(
                self.plain[c.row] if c.row in unsure and c.kind == "coulomb" else c
                for c in self.rich
                if c.row not in unsure or c.kind != "stribeck"
            )
            columns = self._beside(bodies)
        return self._polished(Problem(columns, bodies))

    def vouched(self, problem: Problem) -> Problem:
        """The problem, or a smaller one where it is far off in postures that were not shown.

        Links are held closer to the model first, then payloads are left out, then all bodies.
        """
        links = self._bodies(SIGMAS[0])
        if not problem.bodies or not links:
            return problem
        elsewhere, before = Elsewhere(self.evidence, links), rms(self.start[self.use])
        loads = tuple(body for body in problem.bodies if body.added)
        smaller = [loads + links, loads] if len(problem.bodies) > len(loads) else []
        for bodies in (problem.bodies, *smaller, links):
            if bodies is not problem.bodies:
                problem = Problem(self._beside(bodies), bodies)
            free = tuple(replace(body, sigma=SIGMA) for body in bodies if body.added)
            beside = free + (bodies[len(free) :] or links)
            equations = self._equations(Problem(problem.columns, beside), self.use)
            if not elsewhere.stretched(self.fit(problem), equations, before):
                return problem
        return Problem(self._columns_of_rows(self.start))

    def _polished(self, problem: Problem) -> Problem:
        """With the widths and speeds that fit best beside all else, where friction falls."""
        rows = {
            c.row for c in problem.columns if c.kind == "stribeck" and not self._described(c.row)
        }
        if not rows:
            return problem
        tried = [problem]
        for _ in range(POLISHED):
            beside = _doubted(Solution(problem, np.empty(0), np.empty(0))).problem
            found = self.fit(beside)
            moved = {r: _moved(found, r) for r in rows}
            columns = tuple(
                _at(c, moved[c.row]) if c.row in rows and c.kind in DRY else c
                for c in problem.columns
            )
            problem = replace(problem, columns=columns)
            tried.append(problem)
        return min(tried, key=self._misfit)

    def _misfit(self, problem: Problem) -> float:
        """The weighed sum of squares that a fit of all instants leaves."""
        left = self.start + applied(self.evidence, self.fit(problem))
        return float((self.weight * left**2)[self.use].sum())

    def _described(self, r: int) -> bool:
        """Does the description know dry friction of the joint? Then its width stays."""
        law = self.evidence.robot.description.joints[r].friction
        return law.coulomb > 0.0 or law.stribeck > 0.0

    def _unsure(self, problem: Problem) -> list[int]:
        """Rows whose friction falls with speed, but not surely once all is fitted together."""
        if not any(c.kind == "stribeck" for c in problem.columns):
            return []
        found = self.with_errors(self.fit(problem))
        told = zip(problem.columns, found.values, found.errors, strict=True)
        return [c.row for c, v, e in told if c.kind == "stribeck" and abs(v) < SURE * e]

    def fit_beside(self, more: tuple[Column, ...], problem: Problem | None = None) -> Solution:
        """Further columns beside a problem, by default the loaded one, with standard errors."""
        problem = problem or self.loaded()
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

    def growth_elsewhere(self, found: Solution) -> Array:
        """By row (R,), how much larger residuals are where the arm was not while it was fitted.

        Each part of the workspace is left out in turn. What is constant there counts for nothing:
        a baseline takes that.

        Args:
            found: a fit of all instants that may be used.

        Returns:
            The ratio to what that leaves there, at least 1.
        """
        whole = self._equations(found.problem, self.use)
        inside, outside = np.zeros((2, len(self.evidence.used)))
        for fold in regions_of(self.evidence, self.use):
            part, start = self.evidence.part(fold.test), self.start[fold.test]
            others = (whole - self._equations(found.problem, fold.test)).solve()
            inside += len(part) * np.var(start + applied(part, found), axis=0)
            outside += len(part) * np.var(start + applied(part, others), axis=0)
        return np.sqrt(np.maximum(outside / np.maximum(inside, 1e-18), 1.0))

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
        beside = _doubted(found)
        equations = self._equations(beside.problem, self.use)
        told = equations.with_errors(beside, left, self.weight, self.use, self.blocks)
        return replace(
            told,
            problem=found.problem,
            values=found.values,
            errors=told.errors[: len(found.values)],
        )

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
            chosen += self._columns_of_row(start, r, rich)
        return tuple(chosen)

    def _columns_of_row(self, start: Array, r: int, rich: list[Column]) -> list[Column]:
        """Those of a row; friction that falls with speed must win clearly."""
        if not any(c.kind == "stribeck" for c in rich):
            return self._best(start, r, _options(rich))[0]
        others = [c for c in rich if c.kind not in DRY]
        plain, cost = self._best(start, r, _options([*others, self.plain[r]]))
        falling, less = self._best(start, r, _options(rich, falling=True))
        return falling if self._clearly(cost, less) else plain

    def _best(
        self, start: Array, r: int, options: list[list[Column]]
    ) -> tuple[list[Column], Array]:
        """The simplest of the options that foretell a row best, and its cost (blocks,)."""
        costs = [self._foretold_row(start, r, option) for option in options]
        best = self._simplest(costs)
        return options[best], costs[best]

    def _foretold_row(self, start: Array, r: int, columns: list[Column]) -> Array:
        """Cost (blocks,) of a row where its own columns alone are fitted to other parts of time."""
        left = np.zeros(start.shape)
        for fold in self.folds:
            left[fold.test, r] = self._row_left(start, r, columns, fold.train, fold.test)
        return self._cost(left, r)

    def _clearly(self, cost: Array, less: Array) -> bool:
        """Is a cost (blocks,) so much less that chance hardly makes it so?"""
        gain = cost - less
        chance = CLEARLY * gain.std() / np.sqrt(len(gain))
        return bool(gain.mean() > max(chance, (SAME - 1.0) * cost.mean()))

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
        """All columns that rows may have, with the width of Coulomb friction that fits best.

        Where friction falls with speed, `plain` has the row's Coulomb friction without that.
        """
        self.plain = {}
        columns: list[Column] = []
        joints = self.evidence.robot.description.joints
        for r in self._rows():
            own = [Column("bias", r)]
            if r < len(joints) and self.moved[r]:
                own.append(Column("viscous", r))
                if joints[r].torque == "motor":
                    own.append(Column("rotor", r))
                own += self._dry_columns(start, r, own)
            columns += own
        return tuple(columns)

    def _dry_columns(self, start: Array, r: int, beside: list[Column]) -> list[Column]:
        """Those of dry friction that fit a row best.

        Its width is finer than `WIDTHS`, and it falls with speed, where that is clear.
        """
        plain = self._best_coulomb(start, r, beside)
        row = start[self.use, r], self.weight[self.use, r]
        dry = DryFriction(self.evidence, r, *row, self.use)
        cost = self._foretold_row(start, r, [*beside, plain])
        if not self._described(r):
            finer = dry.plain(plain.width)
            less = self._foretold_row(start, r, [*beside, finer])
            if self._clearly(cost, less):
                plain, cost = finer, less
            elif less.mean() < cost.mean():
                cost = less
        falling = dry.falling()
        if not falling or not self._sure(start, r, [*beside, *falling]):
            return [plain]
        if not self._clearly(cost, self._foretold_row(start, r, [*beside, *falling])):
            return [plain]
        self.plain[r] = plain
        return falling

    def _sure(self, start: Array, r: int, columns: list[Column]) -> bool:
        """Is the last of a row's columns no work of chance, where all of them are fitted?"""
        only = replace(self.evidence, used=np.arange(len(self.evidence.used)) == r)
        problem = Problem(tuple(columns))
        found = Equations.of(only, problem, start, self.weight, self.use).solve()
        left, last = start + applied(only, found), len(columns) - 1
        beside = _doubted(found)
        equations = Equations.of(only, beside.problem, start, self.weight, self.use)
        told = equations.with_errors(beside, left, self.weight, self.use, self.blocks)
        return bool(abs(told.values[last]) > SURE * told.errors[last])

    def _best_coulomb(self, start: Array, r: int, beside: list[Column]) -> Column:
        law = self.evidence.robot.description.joints[r].friction
        widths = (law.coulomb_width,) if self._described(r) else WIDTHS
        options = [Column("coulomb", r, width) for width in widths]
        costs = []
        for option in options:
            left = self._row_left(start, r, [*beside, option], self.use, self.use)
            costs.append(float((self.weight[self.use, r] * left**2).sum()))
        return next(o for o, c in zip(options, costs, strict=True) if c <= SAME * min(costs))


def _options(rich: list[Column], falling: bool = False) -> list[list[Column]]:
    """Sets of columns that a row may have, simpler ones first; `falling`: those with that."""
    kinds = [
        (),
        ("bias",),
        ("bias", "coulomb"),
        ("bias", "viscous"),
        ("bias", "coulomb", "viscous"),
        ("bias", "coulomb", "viscous", "rotor"),
    ]
    if falling:
        kinds = [(*of, "stribeck") for of in kinds if "coulomb" in of]
    sets = [tuple(c for c in rich if c.kind in of) for of in kinds]
    return [list(option) for option in dict.fromkeys(sets)]


def rms(left: Array) -> Array:
    """Root mean square of each row."""
    return np.sqrt(np.mean(left**2, axis=0)) if len(left) else np.zeros(left.shape[1])


def _doubted(found: Solution) -> Solution:
    """With what width and speed do, where friction falls with speed: errors count that doubt."""
    columns = found.problem.columns
    more = tuple(
        replace(c, kind=kind)
        for c in columns
        if c.kind == "stribeck"
        for kind in ("width", "speed")
    )
    problem = replace(found.problem, columns=(*columns, *more))
    return replace(found, problem=problem, values=np.append(found.values, np.zeros(len(more))))


def _at(column: Column, place: dict[str, float]) -> Column:
    speed = place["speed"] if column.kind == "stribeck" else 0.0
    return replace(column, width=place["width"], speed=speed)


def _moved(found: Solution, r: int) -> dict[str, float]:
    """The width and the speed of a row after a step of Gauss and Newton, not too far away."""
    own = next(c for c in found.problem.columns if (c.kind, c.row) == ("stribeck", r))
    coulomb, stribeck = (found.value(kind, r) for kind in DRY)
    told = {}
    for kind, size in (("width", coulomb + stribeck), ("speed", stribeck)):
        step = found.value(kind, r) / max(size, 1e-9)
        told[kind] = rounded(getattr(own, kind) * float(np.exp(np.clip(step, -LONGEST, LONGEST))))
    told["speed"] = max(told["speed"], APART * told["width"])
    return told


def _sum(parts: list[Equations]) -> Equations:
    total = parts[0]
    for part in parts[1:]:
        total = total + part
    return total
