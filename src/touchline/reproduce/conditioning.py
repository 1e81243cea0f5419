# SPDX-License-Identifier: Apache-2.0
"""Well and badly conditioned configurations of an end effector's Jacobian, found numerically.

Metres and radians weigh alike, as is usual where a condition number of a 6 x n Jacobian is given.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.observer.dynamics import point_jacobian

TRIALS, FINALISTS = 4000, 2
STEP = 1e-6  # of the difference quotients [rad]
ROUNDS = 50


@dataclass(frozen=True)
class EndEffector:
    """A point (3,) [m] of a link of a robot, in the link's frame."""

    robot: Robot
    link: str
    point: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def jacobian(self, q: Array) -> Array:
        """Jacobian (..., 6, n) for joint positions (..., n), world axes."""
        return point_jacobian(self.robot, q, self.link, self.point)

    def condition(self, q: Array) -> Array:
        """Largest over smallest singular value (...) of the Jacobian, infinite where singular."""
        sigma = np.linalg.svd(self.jacobian(q), compute_uv=False)
        with np.errstate(divide="ignore"):
            return sigma[..., 0] / sigma[..., -1]


def best_conditioned(effector: EndEffector, lower: Array, upper: Array, seed: int) -> Array:
    """The configuration (n,) of least condition number within limits (n,).

    Random trials, the best of them refined. Turning the first joint turns everything and turning
    the last changes nothing if the point is on its axis: both stay 0, and so does every other
    coordinate that makes no difference there.
    """
    from scipy.optimize import minimize

    inner = slice(1, len(lower) - 1)
    rng = np.random.default_rng(seed)
    trials = np.zeros((TRIALS, len(lower)))
    trials[:, inner] = rng.uniform(lower[inner], upper[inner], (TRIALS, len(lower[inner])))
    order = np.argsort(effector.condition(trials))[:FINALISTS]

    def cost(x: Array) -> float:
        return float(np.log(effector.condition(np.r_[0.0, x, 0.0])))

    limits = list(zip(lower[inner], upper[inner], strict=True))
    options = {"xatol": 1e-7, "fatol": 1e-10, "maxiter": 800, "adaptive": True}
    ends = [
        minimize(cost, trials[i, inner], method="Nelder-Mead", bounds=limits, options=options)
        for i in order
    ]
    best = min(ends, key=lambda end: end.fun)
    return _plainest(effector, np.r_[0.0, best.x, 0.0])


def _plainest(effector: EndEffector, q: Array) -> Array:
    """The same with every coordinate 0 that can be without loss."""
    for i in range(len(q)):
        other = q.copy()
        other[i] = 0.0
        if effector.condition(other) < effector.condition(q) * (1 + 1e-9):
            q = other
    return q


def nearby_singularity(effector: EndEffector, start: Array) -> Array:
    """A singular configuration (n,) near `start` (n,), by Newton's method on the singular value.

    The smallest singular value with its sign, `u^T J v`, changes smoothly and crosses zero; its
    slope is `u^T dJ/dq_i v`.

    Raises:
        RuntimeError: if none is found.
    """
    q = np.array(start, dtype=float)
    for _ in range(ROUNDS):
        U, sigma, Vt = np.linalg.svd(effector.jacobian(q), full_matrices=False)
        if sigma[-1] < 1e-14 * sigma[0]:
            return q
        shifts = STEP * np.eye(len(q))
        dJ = (effector.jacobian(q + shifts) - effector.jacobian(q - shifts)) / (2 * STEP)
        slope = np.einsum("a,iab,b->i", U[:, -1], dJ, Vt[-1])
        q = q - sigma[-1] * slope / (slope @ slope)
    raise RuntimeError(f"no singular configuration was found near {start}")
