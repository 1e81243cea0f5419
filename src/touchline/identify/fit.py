# SPDX-License-Identifier: Apache-2.0
"""Least squares on the filtered equations: some parameters free, the rest as described."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import LinAlgError, cho_factor, cho_solve

from touchline.arrays import Array, Index, Mask
from touchline.identify.evidence import Evidence
from touchline.identify.physical import PhysicalBody
from touchline.identify.regressor import PARAMETERS, body_vector
from touchline.model.corrections import load_inertia
from touchline.model.robot import Robot
from touchline.model.transforms import move_inertia

BIAS, BIAS_SHARE = 1.0, 0.1  # 1 sigma of a bias: N or Nm, or this part of the largest reading
LEAN = np.radians(0.5)  # 1 sigma of how far a base leans otherwise than described: check names 1.5
FRAME = {"turn": 0.1, "shift": 0.02}  # rad, m: 1 sigma of how far a sensor's frame is off
STEPS = 30  # of Gauss and Newton at most
SLIGHTLY = 1.05  # factor of a width or speed, to see what it does
ENOUGH = 1e-6  # a step this small changes nothing that can be measured


@dataclass(frozen=True)
class Column:
    """One free number that enters the equations linearly.

    Attributes:
        kind: "bias", "viscous", "coulomb", "stribeck", "rotor", "turn", "shift" or "lean"; "gain"
            for what is expected more, as a part of it; for what it does to errors, "width" and
            "speed" of friction, per unit of their logarithm.
        row: of the joint or of the sensor's axis; of `turn` and `shift` the sensor's first.
        width: of the Coulomb friction [rad/s], or of what it has more at slow speeds.
        speed: with which that falls [rad/s].
        axis: of the sensor's frame that it turns about, or is shifted along; of a lean, which of
            the level ones.
        count: of the rows that a lean enters, which are all.
        rows: all that it enters.
        positive: may the value not be below zero?
    """

    kind: str
    row: int
    width: float = 0.0
    axis: int = 0
    speed: float = 0.0
    count: int = 1

    @property
    def rows(self) -> range:
        """The rows that it enters."""
        if self.kind in FRAME:
            return range(self.row, self.row + 6)
        return range(self.row, self.row + self.count)

    @property
    def positive(self) -> bool:
        """May the value not be below zero?"""
        return self.kind in ("viscous", "coulomb", "stribeck", "rotor")


@dataclass(frozen=True)
class BodyChange:
    """A node whose inertial parameters are free.

    Attributes:
        node: its number.
        model: (10,) those of the link that is corrected, in the node's frame.
        sigma: prior, 1 sigma of each of the ten numbers of `PhysicalBody`.
        added: a body that the model lacks, `model` being a first guess.
    """

    node: int
    model: Array
    sigma: float
    added: bool = False

    def physical(self) -> PhysicalBody:
        """Its parameters as a function of ten free numbers."""
        return PhysicalBody(self.model, self.added)


@dataclass(frozen=True)
class Problem:
    """What is free.

    Attributes:
        columns: linear ones.
        bodies: with physical inertias.
    """

    columns: tuple[Column, ...] = ()
    bodies: tuple[BodyChange, ...] = ()


@dataclass(frozen=True)
class Solution:
    """What was found.

    Attributes:
        problem: what was free.
        values: of the columns, to be added to the described ones.
        steps: (bodies, 10) of `PhysicalBody`.
        errors: 1 sigma of the columns.
        body_errors: (bodies, 10) 1 sigma of the ten parameters.
    """

    problem: Problem
    values: Array
    steps: Array
    errors: Array = field(default_factory=lambda: np.empty(0))
    body_errors: Array = field(default_factory=lambda: np.empty((0, PARAMETERS)))

    def changes(self) -> Array:
        """(bodies, 10) what is added to the ten parameters."""
        found = [
            b.physical().change(step)
            for b, step in zip(self.problem.bodies, self.steps, strict=True)
        ]
        return np.array(found).reshape(-1, PARAMETERS)

    def value(self, kind: str, row: int) -> float:
        """What was found of a kind in a row; 0 if it was not free."""
        for column, value in zip(self.problem.columns, self.values, strict=True):
            if (column.kind, column.row) == (kind, row):
                return float(value)
        return 0.0

    def error(self, kind: str, row: int) -> float:
        """1 sigma of that; 0 if it was not free."""
        for column, error in zip(self.problem.columns, self.errors, strict=True):
            if (column.kind, column.row) == (kind, row):
                return float(error)
        return 0.0


class Equations:
    """The normal equations of some instants for one problem.

    Attributes:
        evidence: all instants.
        problem: what is free.
        normal, gradient: of half the weighed sum of squares, at zero; the ten parameters of each
            body stand after the columns.
    """

    def __init__(self, evidence: Evidence, problem: Problem, normal: Array, gradient: Array):
        self.evidence, self.problem = evidence, problem
        self.normal, self.gradient = normal, gradient

    @staticmethod
    def of(
        evidence: Evidence, problem: Problem, start: Array, weight: Array, use: Mask
    ) -> "Equations":
        """Sums up some instants.

        Args:
            evidence: all instants.
            problem: what is free.
            start: (N, R) the residual that the columns and bodies are added to.
            weight: (N, R) one over variance.
            use: (N,) the instants.
        """
        linear = len(problem.columns)
        size = linear + PARAMETERS * len(problem.bodies)
        normal, gradient = np.zeros((size, size)), np.zeros(size)
        for r, index, A in _rows_of(evidence, problem, use):
            w = weight[use, r]
            normal[np.ix_(index, index)] += A.T @ (w[:, None] * A)
            gradient[index] += A.T @ (w * start[use, r])
        return Equations(evidence, problem, normal, gradient)

    def __add__(self, other: "Equations") -> "Equations":
        normal, gradient = self.normal + other.normal, self.gradient + other.gradient
        return Equations(self.evidence, self.problem, normal, gradient)

    def __sub__(self, other: "Equations") -> "Equations":
        normal, gradient = self.normal - other.normal, self.gradient - other.gradient
        return Equations(self.evidence, self.problem, normal, gradient)

    def only(self, problem: Problem) -> "Equations":
        """The same instants with less that is free, or with other priors."""
        linear = len(self.problem.columns)
        index = [self.problem.columns.index(column) for column in problem.columns]
        nodes = [body.node for body in self.problem.bodies]
        for body in problem.bodies:
            first = linear + PARAMETERS * nodes.index(body.node)
            index += range(first, first + PARAMETERS)
        normal = self.normal[np.ix_(index, index)]
        return Equations(self.evidence, problem, normal, self.gradient[index])

    def solve(self) -> Solution:
        """The most likely parameters."""
        physical = [b.physical() for b in self.problem.bodies]
        linear = len(self.problem.columns)
        prior = self.whole_prior()
        least = np.array([_least(self.evidence, c) for c in self.problem.columns])
        held = np.zeros(linear, dtype=bool)
        values, steps = np.zeros(linear), np.zeros((len(physical), PARAMETERS))
        for _ in range(STEPS):
            J = self._jacobian(physical, steps)
            x = np.concatenate(
                [values, *(b.change(s) for b, s in zip(physical, steps, strict=True))]
            )
            now = np.concatenate([values, steps.ravel()])
            H = J.T @ self.normal @ J + np.diag(prior)
            g = J.T @ (self.gradient + self.normal @ x) + prior * now
            free = ~np.concatenate([held, np.zeros(steps.size, dtype=bool)])
            change = np.zeros(len(now))
            change[free] = -_solved(H[np.ix_(free, free)], g[free])
            size = np.abs(change[linear:]).max(initial=0.0)
            change *= min(1.0, 0.5 / max(size, 1e-12))
            now = now + change
            beyond = now[:linear] < least
            now[:linear] = np.where(beyond, least, now[:linear])
            newly = beyond & ~held
            held |= beyond
            values, steps = now[:linear], now[linear:].reshape(steps.shape)
            if size < ENOUGH and not newly.any():
                break
        return Solution(self.problem, values, steps)

    def prior(self) -> Array:
        """One over variance of the columns before any data: biases are small, the rest is free."""
        prior = 1e-9 * np.maximum(np.diag(self.normal)[: len(self.problem.columns)], 1e-12)
        for i, column in enumerate(self.problem.columns):
            if column.kind == "bias":
                largest = float(np.abs(self.evidence.reading[:, column.row]).max(initial=0.0))
                prior[i] += max(BIAS, BIAS_SHARE * largest) ** -2.0
            elif column.kind in FRAME:
                prior[i] += FRAME[column.kind] ** -2.0
            elif column.kind == "lean":
                prior[i] += LEAN**-2.0
        return prior

    def whole_prior(self) -> Array:
        """The same of all free numbers, the steps of the bodies last."""
        bodies = [np.full(PARAMETERS, body.sigma**-2.0) for body in self.problem.bodies]
        return np.concatenate([self.prior(), *bodies])

    def jacobian_at_start(self) -> Array:
        """Derivatives of the parameters with respect to the free numbers, at no change."""
        return self.jacobian(np.zeros((len(self.problem.bodies), PARAMETERS)))

    def jacobian(self, steps: Array) -> Array:
        """The same where the bodies have taken steps (bodies, 10)."""
        return self._jacobian([body.physical() for body in self.problem.bodies], steps)

    def _jacobian(self, physical: list[PhysicalBody], steps: Array) -> Array:
        linear = len(self.problem.columns)
        J = np.eye(linear + steps.size)
        for i, (body, step) in enumerate(zip(physical, steps, strict=True)):
            at = linear + PARAMETERS * i
            J[at : at + PARAMETERS, at : at + PARAMETERS] = body.jacobian(step)
        return J

    def with_errors(
        self, found: Solution, left: Array, weight: Array, use: Mask, blocks: NDArray
    ) -> Solution:
        """The solution with standard errors.

        Args:
            found: from these equations.
            left: (N, R) residuals with it.
            weight: (N, R) as for `of`.
            use: (N,) the instants.
            blocks: (N,) numbers of blocks of time.

        The residuals of one block of time may be correlated as they like; those of two are not
        (a sandwich of the normal matrix and the blocks' gradients).
        """
        physical = [b.physical() for b in self.problem.bodies]
        linear = len(self.problem.columns)
        J = self._jacobian(physical, found.steps)
        prior = self.whole_prior()
        bread = np.linalg.pinv(J.T @ self.normal @ J + np.diag(prior))
        numbers, at = np.unique(blocks[use], return_inverse=True)
        scores = np.zeros((len(numbers), len(self.gradient)))
        for r, index, A in _rows_of(self.evidence, self.problem, use):
            scored = A * (weight[use, r] * left[use, r])[:, None]
            own = np.zeros((len(numbers), len(index)))
            np.add.at(own, at, scored)
            scores[:, index] += own
        scores = scores @ J
        count = len(scores)
        meat = scores.T @ scores * count / max(count - 1, 1)
        C = bread @ (meat + np.diag(prior)) @ bread
        full = J @ C @ J.T
        sigma = np.sqrt(np.maximum(np.diag(full), 0.0))
        return Solution(
            self.problem,
            found.values,
            found.steps,
            sigma[:linear],
            sigma[linear:].reshape(-1, PARAMETERS),
        )


def _solved(H: Array, g: Array) -> Array:
    """H^-1 g of a matrix that is positive definite, or nearly so."""
    size = np.sqrt(np.maximum(np.diag(H), 1e-300))
    try:
        found = cho_solve(cho_factor(H / np.outer(size, size)), g / size) / size
    except LinAlgError:
        found = np.linalg.lstsq(H, g, rcond=None)[0]
    return np.asarray(found, dtype=float)


def gradient_of(e: Evidence, problem: Problem, column: Array, weight: Array, use: Mask) -> Array:
    """The gradient of half the weighed sum of squares of a column (N, R), as of `Equations`.

    Of several columns (N, R, K) those of all, (free numbers, K).
    """
    size = len(problem.columns) + PARAMETERS * len(problem.bodies)
    gradient = np.zeros((size, *column.shape[2:]))
    for r, index, A in _rows_of(e, problem, use):
        weighed = A * weight[use, r, None]
        gradient[index] += weighed.T @ column[use, r]
    return gradient


def _rows_of(e: Evidence, problem: Problem, use: Mask) -> Iterator[tuple[int, Index, Array]]:
    """Rows with something free in them: number, indices of the parameters, equations (N, ...)."""
    linear = len(problem.columns)
    size = linear + PARAMETERS * len(problem.bodies)
    nodes = [body.node for body in problem.bodies]
    for r in np.flatnonzero(e.used).tolist():
        own = [i for i, c in enumerate(problem.columns) if r in c.rows]
        parts = [column_of(e, problem.columns[i], r)[use, None] for i in own]
        index = own
        if nodes:
            part = e.model[:, r][use][:, nodes]
            parts.append(part.reshape(len(part), -1))
            index = own + list(range(linear, size))
        if parts:
            yield r, np.array(index), np.concatenate(parts, axis=1)


def column_of(e: Evidence, column: Column, r: int) -> Array:
    """A column's filtered signal (N,) in a row that it enters."""
    if column.kind == "bias":
        return np.ones(len(e))
    if column.kind == "gain":
        return e.load[:, r]
    if column.kind == "viscous":
        return e.speed[:, r]
    if column.kind == "rotor":
        return e.rotor[:, r]
    if column.kind == "lean":
        return e.leaning[:, r, column.axis]
    if column.kind in FRAME:
        return _frame_column(e, column, r - column.row)
    if column.kind == "stribeck":
        return e.falling(r, column.width, column.speed)
    if column.kind == "width":
        return _slope(lambda width: e.coulomb(r, width), column.width)
    if column.kind == "speed":
        return _slope(lambda speed: e.falling(r, column.width, speed), column.speed)
    return e.coulomb(r, column.width)


def _slope(of: Callable[[float], Array], at: float) -> Array:
    """How a column changes with the logarithm of a width or speed."""
    return (of(at * SLIGHTLY) - of(at / SLIGHTLY)) / (2.0 * np.log(SLIGHTLY))


def _frame_column(e: Evidence, column: Column, component: int) -> Array:
    """What the described frame would read more, were the true one turned or shifted by a unit.

    The true frame is turned by phi and shifted by p, both small and in its own axes. A reading
    (f, m) then is (f + phi x f, m + phi x m + p x f) where it is described. A residual is the
    model less that.
    """
    moment, i = divmod(component, 3)
    if column.kind == "shift" and not moment:
        return np.zeros(len(e))
    first = column.row + (3 if moment and column.kind == "turn" else 0)
    j, k = (i + 1) % 3, (i + 2) % 3  # (a x v)_i = a_j v_k - a_k v_j
    if column.axis == j:
        return -e.reading[:, first + k]
    if column.axis == k:
        return e.reading[:, first + j]
    return np.zeros(len(e))


def applied(e: Evidence, found: Solution) -> Array:
    """What a solution adds to the residual (N, R)."""
    added = np.zeros(e.reading.shape)
    for column, value in zip(found.problem.columns, found.values, strict=True):
        for r in column.rows:
            added[:, r] += value * column_of(e, column, r)
    if found.problem.bodies:
        changes = np.zeros(e.model.shape[2:])
        np.add.at(changes, [body.node for body in found.problem.bodies], found.changes())
        added += e.model.reshape(*added.shape, -1) @ changes.ravel()
    return np.where(e.used, added, 0.0)


def _least(e: Evidence, column: Column) -> float:
    """The least change of a column's value: the described value must not fall below zero."""
    if not column.positive:
        return -np.inf
    joint = e.robot.description.joints[column.row]
    if column.kind == "rotor":
        return -joint.rotor_inertia
    return -float(getattr(joint.friction, column.kind))


def main_links(robot: Robot) -> dict[int, tuple[str, Array]]:
    """Per node with mass, its heaviest link and that link's ten parameters in the node's frame.

    Loads that the description adds to the link are not part of them.
    """
    found: dict[int, tuple[str, Array]] = {}
    for i, node in enumerate(robot.nodes):
        links = [link_vector(robot, name) for name in node.links]
        if links and max(x[0] for x in links) > 0:
            best = int(np.argmax([x[0] for x in links]))
            found[i] = node.links[best], links[best]
    return found


def link_vector(robot: Robot, name: str) -> Array:
    """Ten parameters of a link without its loads, in the frame of its node."""
    T = robot.places[name].T_node_link
    own = body_vector(move_inertia(robot.mechanism.links[name].inertia, T))
    for load in robot.description.loads:
        if load.link == name:
            own = own - body_vector(move_inertia(load_inertia(load), T))
    return own if own[0] > 1e-6 else np.zeros(PARAMETERS)
