# SPDX-License-Identifier: Apache-2.0
"""A force that rests on the arm throughout a recording.

It neither begins nor ends, so nothing of it stands out; a payload, offsets and gains take a part of
it. Here it is fitted beside all of these and a base that leans. It is constant in the world, as a
hand's, or in the frame of a link, as that of a cable along it.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.identify.choice import LEAST_SCATTER, SIGMAS, Chooser
from touchline.identify.elsewhere import row_groups
from touchline.identify.evidence import Evidence
from touchline.identify.fit import (
    BodyChange,
    Column,
    Equations,
    Problem,
    column_of,
    gradient_of,
    main_links,
)
from touchline.identify.identification import Identification, rms
from touchline.identify.leaning import lean_columns
from touchline.identify.payload import RADIUS, SIGMA, seen_leaves
from touchline.identify.regressor import PARAMETERS, body_vector, outboard_nodes, row_twists
from touchline.model.mechanism import Inertia
from touchline.observer.dynamics import posture

# A hand of 12 N explains 72 to 100 % on simulated arms, nothing explains more than 3 % where
# nothing touches. Of real arms, what friction leaves looks like some force, too: see docs.
FORCE = 4.0  # N
SHARE = 0.35  # of the squares that are left without it
INSTANTS = 2000  # that are enough for a force that never changes
GAIN = 0.1  # 1 sigma of how far a torque's gain may be off, as a part of it
LARGE = 100.0  # N, 1 sigma of the force before any data
REACH = 0.2  # m, 1 sigma of how far from the link's origin it acts
TURNS = 20  # of fitting the force, then its place: each is linear while the other is held
PIECE = 2.0  # s, in which a hand changes little and motion much
# Of the squares that are left, by one force in each piece. Of an arm touched for 64 to 100 % of the
# time by touches of 6 s that were taken for usual: 71 to 80 %. Of real free arms 20 % at most.
PIECES_SHARE = 0.5
MOVED = 0.1  # rad; where no joint moves more in a piece, any error looks like some force
LEAST_PIECES = 5
TERMS = 12  # linear numbers of one force: see `_columns`


@dataclass(frozen=True)
class Resting:
    """A force that never changes, and what it explains.

    Attributes:
        link: that it acts on.
        frame: the link whose frame it is constant in; "": the world's.
        force: (3,) [N] in that frame.
        explained: part of the weighed squares that are left without it.
    """

    link: str
    frame: str
    force: Array
    explained: float

    @property
    def size(self) -> float:
        """How large it is [N]."""
        return float(np.linalg.norm(self.force))

    @property
    def there(self) -> bool:
        """Is it so large, and does it explain so much, that something must touch the arm?"""
        return self.size > FORCE and self.explained > SHARE


def find_resting(found: Identification) -> Resting | None:
    """The constant force that explains most beside all that calibration fits.

    Args:
        found: what was identified; its touched instants play no part.

    Returns:
        The force, on the link where it explains most; None where no row feels any.
    """
    use = np.flatnonzero(~found.touched)
    e = found.evidence.part(use[:: max(1, -(-len(use) // INSTANTS))])
    beside = _Beside(e, found.left(e))
    best: Resting | None = None
    for node, (link, _) in main_links(e.robot).items():
        for fixed in (False, True):
            columns = _columns(e, node, fixed)
            if not np.abs(columns[:, e.used]).max(initial=0.0) > 0.0:
                continue
            force, explained = beside.explained(columns)
            if best is None or explained > best.explained:
                best = Resting(link, link if fixed else "", force, explained)
    return best


@dataclass(frozen=True)
class Changing:
    """One force in each piece of the recording, on the link where it explains most.

    Attributes:
        force: median of its size [N].
        explained: part of the weighed squares that are left without.
    """

    force: float
    explained: float

    @property
    def there(self) -> bool:
        """Must something touch the arm most of the time?"""
        return self.force > FORCE and self.explained > PIECES_SHARE


def find_changing(found: Identification) -> Changing | None:
    """Forces that rest for seconds and explain what calibration and a lean of the base leave.

    Args:
        found: what was identified; its touched instants play no part.

    Returns:
        What they explain; None where the arm moves too little to tell.
    """
    use = np.flatnonzero(~found.touched)
    e = found.evidence.part(use[:: max(1, -(-len(use) // INSTANTS))])
    left = found.left(e)
    weight = 1.0 / _sizes(e, left)
    left = _Beside(e, left).left()
    columns = [_columns(e, node, False)[..., :3] for node in main_links(e.robot)]
    pieces = np.floor((e.time - e.time.min(initial=0.0)) / PIECE).astype(int)
    whole, explained, forces = 0.0, 0.0, []
    for number in np.unique(e.recording):
        for piece in np.unique(pieces[e.recording == number]):
            own = (e.recording == number) & (pieces == piece)
            if np.ptp(e.q[own], axis=0).max(initial=0.0) < MOVED:
                continue
            y = (left[own] * weight)[:, e.used].ravel()
            best, force = 0.0, 0.0
            for Z in columns:
                X = (Z[own] * weight[:, None])[:, e.used].reshape(-1, 3)
                f = np.linalg.solve(X.T @ X + LARGE**-2.0 * np.eye(3), X.T @ y)
                gain = float(2.0 * f @ (X.T @ y) - f @ (X.T @ X) @ f)
                if gain > best:
                    best, force = gain, float(np.linalg.norm(f))
            whole, explained = whole + float(y @ y), explained + best
            forces.append(force)
    if len(forces) < LEAST_PIECES:
        return None
    return Changing(float(np.median(forces)), explained / max(whole, 1e-12))


class _Beside:
    """What calibration fits, free once more: the normal equations about what it found.

    Args:
        e: the instants.
        left: (N, R) what calibration leaves [N or Nm].
    """

    def __init__(self, e: Evidence, left: Array) -> None:
        every = np.ones(len(e), dtype=bool)
        self._e, self._left, self._every = e, left, every
        self._weight = np.broadcast_to(_sizes(e, left) ** -2.0, left.shape)
        chooser = Chooser(e, every)
        links = chooser.richest(SIGMAS[-1]).bodies
        ball = body_vector(Inertia(1.0, np.zeros(3), RADIUS**2 * np.eye(3)))
        loads = [BodyChange(i, ball, SIGMA, added=True) for i in seen_leaves(e)] if links else []
        gains = [Column("gain", r) for r in range(e.joints) if e.used[r]]
        self._problem = Problem((*chooser.rich, *gains, *lean_columns(e)), (*links, *loads))
        equations = Equations.of(e, self._problem, left, self._weight, every)
        prior, J = equations.whole_prior(), equations.jacobian_at_start()
        for i, column in enumerate(self._problem.columns):
            if column.kind == "gain":
                prior[i] += GAIN**-2.0
        first = len(self._problem.columns) + PARAMETERS * len(links)
        J[first:, first:] = np.eye(len(J) - first)  # a load may go altogether, or be less than none
        self._J = J
        self._H = J.T @ equations.normal @ J + np.diag(prior)
        self._gradient = J.T @ equations.gradient
        self._taken = np.linalg.solve(self._H, self._gradient)
        whole = float((self._weight * left**2)[:, e.used].sum())
        self._without = whole - float(self._gradient @ self._taken)

    def left(self) -> Array:
        """What is left (N, R) without a force, all the rest being free."""
        e, numbers = self._e, -self._J @ self._taken
        linear = len(self._problem.columns)
        left = self._left.copy()
        for column, value in zip(self._problem.columns, numbers, strict=False):
            for r in column.rows:
                left[:, r] += value * column_of(e, column, r)
        for i, body in enumerate(self._problem.bodies):
            first = linear + PARAMETERS * i
            left += e.model[:, :, body.node] @ numbers[first : first + PARAMETERS]
        return np.where(e.used, left, 0.0)

    def explained(self, columns: Array) -> tuple[Array, float]:
        """The force (3,) that fits best, and the part it explains of what is left without it.

        Args:
            columns: (N, R, TERMS) as of `_columns`.
        """
        C = self._crossed(columns)
        held = np.linalg.solve(self._H, C)
        A = self._normal(columns, columns) - C.T @ held
        b = self._normal(columns, self._left[..., None])[:, 0] - held.T @ self._gradient
        f, c = np.zeros(3), np.zeros(3)
        for _ in range(TURNS):
            F = np.vstack([np.eye(3), np.kron(c[:, None], np.eye(3))])
            f = np.linalg.solve(F.T @ A @ F + LARGE**-2.0 * np.eye(3), F.T @ b)
            P = np.vstack([np.zeros((3, 3)), np.kron(np.eye(3), f[:, None])])
            at_origin = A[:, :3] @ f
            c = np.linalg.solve(P.T @ A @ P + REACH**-2.0 * np.eye(3), P.T @ (b - at_origin))
        x = np.concatenate([f, np.outer(c, f).ravel()])
        return f, float(2.0 * b @ x - x @ A @ x) / max(self._without, 1e-12)

    def _normal(self, one: Array, other: Array) -> Array:
        """(K, L) sums of products of columns (N, R, K) and (N, R, L), weighed."""
        used, weight = self._e.used, self._weight[..., None]
        flat = (weight * one)[:, used].reshape(-1, one.shape[2])
        return flat.T @ other[:, used].reshape(-1, other.shape[2])

    def _crossed(self, columns: Array) -> Array:
        """The same of the problem's free numbers with columns (N, R, K)."""
        problem, weight = self._problem, self._weight
        return self._J.T @ gradient_of(self._e, problem, columns, weight, self._every)


def _sizes(e: Evidence, left: Array) -> Array:
    """(R,) what is usually left of rows of a unit and place [N or Nm].

    Not of a row by itself: rows that hold noise alone would count as much as those that tell.
    """
    sizes = np.maximum(rms(left), LEAST_SCATTER * np.abs(e.reading).max(axis=0, initial=0.0))
    sizes = np.maximum(sizes, 1e-9)
    for group in row_groups(e):
        sizes[group] = np.sqrt(np.mean(sizes[group] ** 2))
    return sizes


def _columns(e: Evidence, node: int, fixed: bool) -> Array:
    """What a force on a node makes of the residual of each row (N, R, TERMS) [N or Nm per N].

    The first three: 1 N at the node's origin along each axis of the world or, if `fixed`, of the
    node. Then, for each axis of the node, what these make more 1 m along it. The filter answers
    late: to first order as if the arm were where it was a time constant before.
    """
    placed = posture(e.robot, e.q - e.qd / e.bandwidth)
    R, p = placed.rotation[node], placed.origin[node]
    axes = R if fixed else np.broadcast_to(np.eye(3), R.shape)
    wrenches = np.zeros((len(e), 6, TERMS))
    wrenches[:, :3, :3] = axes
    wrenches[:, 3:, :3] = np.cross(p[:, :, None], axes, axisa=1, axisb=1, axisc=1)
    for k in range(3):
        along = slice(3 + 3 * k, 6 + 3 * k)
        wrenches[:, 3:, along] = np.cross(R[:, :, k, None], axes, axisa=1, axisb=1, axisc=1)
    columns = np.zeros((len(e), len(e.rows), TERMS))
    for r, inner, S in row_twists(e.robot, e.rows, placed):
        if node in outboard_nodes(e.robot, inner):
            columns[:, r] += np.einsum("ni,nik->nk", S, wrenches)
    return columns
