# SPDX-License-Identifier: Apache-2.0
"""What physics leaves of joint torques, learned as tables over a joint's own motion.

The table of a joint has nodes over its position and velocity, and is bilinear between them. Each
node's hat goes through the observer's own filter, so the residual is linear in the torques at the
nodes. Their prior is a Gaussian process; the posterior at the nodes is the table and its doubt
(structured kernel interpolation: Wilson and Nickisch, ICML 2015). A node in whose cells nothing was
seen is 0, so the table is off there.

A joint gets a table only if that foretells parts of time and of the workspace that the fit has not
seen. What it learned counts only as much as suits each of these parts: where a rest hangs on other
joints as well, a table may foretell nine parts and harm the tenth.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Mask
from touchline.identify.choice import Fold, folds_of, regions_of
from touchline.identify.evidence import Evidence
from touchline.identify.fit import applied
from touchline.identify.identification import Identification, rms
from touchline.identify.touches import usual_scatter
from touchline.model.learned_rest import LearnedRest
from touchline.model.robot import Robot

POSITIONS, SPEEDS = 16, 17  # nodes at most
APART, APART_SPEED = 0.12, 0.5  # rad, and in units of `_bend`: nodes are at least so far apart
LENGTH, LENGTH_SPEED = 0.3, 1.0  # over which a table may change, in the same units
SLOW = 0.05  # rad/s; below it nodes stand as closely as that, beyond ever farther apart
KNOWN, UNKNOWN = 0.5, 0.9  # of the prior variance: from there on a node counts less, and not at all
CORRELATED = 0.2  # equations closer than the filter's memory repeat each other
LEAST = 0.05  # of the residual's usual scatter is taken as noise at least
HELPS = 0.99  # of the RMS: what a table must leave at most, in time and space it has not seen
HUBER = 3.0  # usual sigmas beyond which an equation loses weight


@dataclass(frozen=True)
class Grid:
    """Nodes of a joint's table, without those on the edges."""

    q: Array
    qd: Array

    @property
    def size(self) -> int:
        """How many nodes there are."""
        return len(self.q) * len(self.qd)

    def hats(self, q: Array, qd: Array) -> Array:
        """How much each node counts (N, nodes) at positions and velocities (N,)."""
        whole = np.einsum("ni,nk->nik", _hats(_widened(self.q), q), _hats(_widened(self.qd), qd))
        return whole[:, 1:-1, 1:-1].reshape(len(q), -1)

    def prior(self) -> Array:
        """Covariance (nodes, nodes) of the torques, in units of their variance."""
        a, b = np.meshgrid(self.q / LENGTH, _bend(self.qd) / LENGTH_SPEED, indexing="ij")
        at = np.column_stack([a.ravel(), b.ravel()])
        square = ((at[:, None] - at[None]) ** 2).sum(axis=-1)
        return np.exp(-0.5 * square) + 1e-6 * np.eye(len(at))

    def table(self, torque: Array, doubt: Array) -> LearnedRest:
        """The table with its edges, where nothing is known."""
        q, qd = _widened(self.q), _widened(self.qd)
        values, sigma = np.zeros((len(q), len(qd))), np.zeros((len(q), len(qd)))
        values[1:-1, 1:-1] = torque.reshape(len(self.q), -1)
        sigma[1:-1, 1:-1] = doubt.reshape(len(self.q), -1)
        flat = (tuple(float(x) for x in a.ravel()) for a in (q, qd, values, sigma))
        return LearnedRest(*flat)


@dataclass(frozen=True)
class Grids:
    """Of all joints; None for one that gets no table. The columns stand joint by joint."""

    of: tuple[Grid | None, ...]

    def hats(self, q: Array, qd: Array) -> Array:
        """How much each node of each joint counts (N, columns)."""
        parts = [g.hats(q[:, j], qd[:, j]) for j, g in enumerate(self.of) if g is not None]
        return np.concatenate([np.empty((len(q), 0)), *parts], axis=1)

    def columns(self, joint: int) -> slice:
        """Those of a joint."""
        sizes = [0 if g is None else g.size for g in self.of]
        first = sum(sizes[:joint])
        return slice(first, first + sizes[joint])


@dataclass(frozen=True)
class Rest:
    """What was learned.

    Attributes:
        tables: by joint; only of those that are better with one.
        before, after: (n,) RMS of the residuals [Nm] on data that played no part, identified
            without tables and with them.
        inside: (n,) the same with tables, on the data that they were learned from.
        region_before, region_after: (n,) the same in parts of the workspace that a fit had not
            seen; NaN for joints without a table.
    """

    tables: dict[str, LearnedRest]
    before: Array
    after: Array
    inside: Array
    region_before: Array
    region_after: Array

    def applied(self, joints: Sequence[str], grids: Grids, columns: NDArray[np.floating]) -> Array:
        """The torques (N, n) [Nm] of the tables, filtered like the columns (N, columns)."""
        torques = np.zeros((len(columns), len(joints)))
        for j, name in enumerate(joints):
            if name in self.tables:
                torques[:, j] = columns[:, grids.columns(j)] @ inner(self.tables[name])
        return torques


def grids_of(evidence: Evidence) -> Grids:
    """Nodes over all that the joints with a torque did."""
    grids: list[Grid | None] = []
    for j in range(evidence.joints):
        q, bent = evidence.q[:, j], _bend(evidence.qd[:, j])
        if not evidence.used[j] or np.ptp(q) < APART or np.ptp(bent) < APART_SPEED:
            grids.append(None)
            continue
        places = min(POSITIONS, int(np.ptp(q) / APART) + 1)
        speeds = min(SPEEDS, int(np.ptp(bent) / APART_SPEED) + 1)
        nodes = np.linspace(q.min(), q.max(), places)
        fast = SLOW * np.sinh(np.linspace(bent.min(), bent.max(), speeds))
        grids.append(Grid(nodes, fast) if min(places, speeds) > 1 else None)
    return Grids(tuple(grids))


def learn(found: Identification, grids: Grids, columns: NDArray[np.floating]) -> Rest:
    """Learns what is left after an identification.

    Args:
        found: the identification.
        grids: from `grids_of` its evidence.
        columns: (N, columns) their hats, filtered, at the instants of the evidence.
    """
    evidence, n = found.evidence, found.evidence.joints
    trained = evidence.residual() + applied(evidence, found.trained)
    whole, use = found.left(), ~found.touched
    tables: dict[str, LearnedRest] = {}
    before, after = rms(trained[found.test])[:n], rms(trained[found.test])[:n]
    regions, parts = list(regions_of(evidence, use)), list(folds_of(evidence, use))
    inside, unseen = rms(whole[use])[:n], np.full((2, n), np.nan)
    for j, grid in enumerate(grids.of):
        if grid is None:
            continue
        hats = columns[:, grids.columns(j)].astype(float)
        joint = _Joint(evidence, grid, hats, whole[:, j])
        held = _Joint(evidence, grid, hats, trained[:, j])
        elsewhere, later = joint.foretold(regions), joint.foretold(parts)
        told = held.foretold([Fold(found.train, found.test)])
        share = min(own.best for own in (*elsewhere, *later, *told))
        if share <= 0.0 or _left([*elsewhere, *later], share) > HELPS:
            continue
        torque, doubt = joint.fit(use)
        torque = share * torque
        after[j] = _rms(told, share)
        inside[j] = rms(whole[use, j, None] + hats[use] @ torque[:, None])[0]
        unseen[:, j] = _rms(elsewhere, 0.0), _rms(elsewhere, share)
        tables[evidence.rows.names[j]] = grid.table(torque, doubt)
    return Rest(tables, before, after, inside, *unseen)


def inner(table: LearnedRest) -> Array:
    """The torques at the nodes of a table (nodes,) without its edges."""
    whole = np.array(table.torque).reshape(len(table.q), len(table.qd))
    return whole[1:-1, 1:-1].ravel()


def with_rest(robot: Robot, tables: dict[str, LearnedRest]) -> Robot:
    """The robot with these tables and no others."""
    description = robot.description
    joints = tuple(replace(j, rest=tables.get(j.name)) for j in description.joints)
    return Robot(replace(description, joints=joints), robot.mechanism)


class _Joint:
    """The equations of one joint: what is left (N,) + hats (N, nodes) @ torques = 0."""

    def __init__(self, evidence: Evidence, grid: Grid, hats: Array, left: Array) -> None:
        self.evidence, self.grid, self.hats, self.residual = evidence, grid, hats, left

    def fit(self, use: Mask) -> tuple[Array, Array]:
        """Torques at the nodes and their doubt (nodes,), 0 where nothing was seen."""
        hats, left = self.hats[use], self.residual[use]
        size = float(np.mean(left**2))
        scatter = usual_scatter(left[:, None], np.array([True]))[0]
        noise = max(scatter**2, LEAST**2 * size)
        far = np.abs(left) / np.sqrt(noise)
        weight = CORRELATED / noise * np.minimum(1.0, HUBER / np.maximum(far, 1e-12))
        precision = hats.T @ (weight[:, None] * hats) + np.linalg.inv(size * self.grid.prior())
        covariance = np.linalg.inv(precision)
        ratio = np.diag(covariance) / size  # of what is not known to what was not known before
        told = np.clip((UNKNOWN - ratio) / (UNKNOWN - KNOWN), 0.0, 1.0)
        torque = -told * (covariance @ (hats.T @ (weight * left)))
        return torque, np.where(told > 0.0, np.sqrt(np.diag(covariance)), 0.0)

    def foretold(self, folds: list[Fold]) -> "list[_Foretold]":
        """What is left at the instants of each fold, which the fit to the others has not seen."""
        found = []
        for fold in folds:
            torque, _ = self.fit(fold.train)
            without, table = self.residual[fold.test], self.hats[fold.test] @ torque
            products = (
                float(a @ b) for a, b in ((without, without), (without, table), (table, table))
            )
            found.append(_Foretold(len(without), *products))
        return found


@dataclass(frozen=True)
class _Foretold:
    """Sums over some instants of products of what is left without a table and what that adds."""

    count: int
    left: float
    both: float
    table: float

    def squares(self, share: float) -> float:
        """Of what is left with so much of the table."""
        return self.left + 2.0 * share * self.both + share**2 * self.table

    @property
    def best(self) -> float:
        """How much of the table leaves least, from 0 to 1; 1 where the table is 0."""
        if self.table <= 0.0:
            return 1.0
        return float(np.clip(-self.both / self.table, 0.0, 1.0))


def _rms(parts: Sequence[_Foretold], share: float) -> float:
    """Root mean square of what is left with so much of the table."""
    total = sum(part.squares(share) for part in parts)
    return float(np.sqrt(max(total, 0.0) / max(sum(part.count for part in parts), 1)))


def _left(parts: Sequence[_Foretold], share: float) -> float:
    """The same, of what it is without."""
    return _rms(parts, share) / max(_rms(parts, 0.0), 1e-12)


def _bend(speed: Array) -> Array:
    """Velocities, ever more closely told the slower they are."""
    return np.arcsinh(speed / SLOW)


def _widened(nodes: Array) -> Array:
    """The nodes and one more on either side."""
    return np.concatenate([[2.0 * nodes[0] - nodes[1]], nodes, [2.0 * nodes[-1] - nodes[-2]]])


def _hats(nodes: Array, x: Array) -> Array:
    """Linear interpolation's weights (N, nodes) at x (N,); 0 beyond the nodes."""
    i = np.clip(np.searchsorted(nodes, x, "right") - 1, 0, len(nodes) - 2)
    share = (x - nodes[i]) / (nodes[i + 1] - nodes[i])
    inside = (x > nodes[0]) & (x < nodes[-1])
    found = np.zeros((len(x), len(nodes)))
    at = np.arange(len(x))
    found[at, i] = np.where(inside, 1.0 - share, 0.0)
    found[at, i + 1] = np.where(inside, share, 0.0)
    return found
