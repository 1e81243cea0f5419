# SPDX-License-Identifier: Apache-2.0
"""Dry friction that falls with speed (Stribeck): which width and speed fit a joint best."""

from collections.abc import Callable

import numpy as np
from scipy.optimize import minimize

from touchline.arrays import Array, Mask
from touchline.identify.evidence import WIDTHS, Evidence
from touchline.identify.fit import Column, column_of
from touchline.identify.laws import SPEEDS as KNOWN
from touchline.model.description import Friction

SPEEDS = (0.02, 0.03, 0.05, 0.07, 0.1, 0.15, 0.2, 0.3, 0.5)  # rad/s, from which the best is sought
APART = 2.0  # times the width at least is such a speed: closer, the two are one
NARROW, FAST = WIDTHS[0], 1.0  # rad/s: beyond these nothing is sought
DIGITS = 3  # of a width or speed
RIDGE = 1e-9  # of the diagonal: of columns that are the same nothing is told
NONE = 1e30  # cost of what cannot be
CLOSE = 3e-3  # of a logarithm: widths and speeds so close are the same


class DryFriction:
    """Widths and speeds of a joint's dry friction, by how well they fit.

    Args:
        evidence: all instants.
        joint: the row.
        start: (M,) its residual without what is sought.
        weight: (M,) one over variance.
        use: (N,) the M instants.
    """

    def __init__(
        self, evidence: Evidence, joint: int, start: Array, weight: Array, use: Mask
    ) -> None:
        described = evidence.robot.description.joints[joint]
        self.joint, self.law = joint, described.friction
        beside = [Column("viscous", joint), Column("bias", joint)]
        if described.torque == "motor":
            beside.append(Column("rotor", joint))
        X = [column_of(evidence, column, joint)[use] for column in beside]
        X = np.concatenate([np.stack(X, axis=1), evidence.laws[use, joint]], axis=1)
        self.beside = len(beside)
        self.normal = X.T @ (weight[:, None] * X)
        self.gradient = X.T @ (weight * start)

    def plain(self, width: float) -> Column:
        """Coulomb friction of about this width, which may be refined."""
        best = _least(lambda x: self._cost(float(np.exp(x[0]))), np.log([width]))
        return Column("coulomb", self.joint, rounded(float(np.exp(best[0]))))

    def falling(self) -> list[Column]:
        """Coulomb friction and what falls from there; none if nothing does, whatever the width."""
        law = self.law
        if law.stribeck:
            starts, fixed = [(law.coulomb_width, law.stribeck_speed)], True
        else:
            widths, fixed = (law.coulomb_width,) if law.coulomb else WIDTHS, False
            starts = [(w, v) for w in widths for v in SPEEDS if v >= APART * w]
        costs = [self._cost(*start) for start in starts]
        if not costs or min(costs) == NONE:
            return []
        width, speed = starts[int(np.argmin(costs))]
        if not fixed and law.coulomb:
            best = _least(lambda x: self._cost(width, float(np.exp(x[0]))), np.log([speed]))
            speed = rounded(float(np.exp(best[0])))
        elif not fixed:
            best = _least(lambda x: self._cost(*np.exp(x).tolist()), np.log([width, speed]))
            width, speed = (rounded(x) for x in np.exp(best).tolist())
        coulomb = Column("coulomb", self.joint, width)
        return [coulomb, Column("stribeck", self.joint, width, speed=speed)]

    def _cost(self, width: float, speed: float = 0.0) -> float:
        """Of the best fit, less what it is without one; `NONE` where there is none such."""
        if width < NARROW or width > WIDTHS[-1] or speed > FAST or 0.0 < speed < APART * width:
            return NONE
        laws = [Friction(1.0, coulomb_width=width)]
        if speed:
            laws.append(Friction(coulomb_width=width, stribeck=1.0, stribeck_speed=speed))
        made = np.zeros((len(self.gradient), self.beside + len(laws)))
        made[: self.beside, : self.beside] = np.eye(self.beside)
        made[self.beside :, self.beside :] = np.stack([law.dry(KNOWN) for law in laws], axis=1)
        normal, gradient = made.T @ self.normal @ made, made.T @ self.gradient
        values = _solved(normal, gradient)
        if self.law.viscous + values[0] < 0.0:  # friction that falls is no negative viscous one
            values[0] = -self.law.viscous
            values[1:] = _solved(normal[1:, 1:], gradient[1:] + normal[1:, 0] * values[0])
        coulomb, stribeck = values[self.beside], values[-1]
        if self.law.coulomb + coulomb < 0.0 or (speed and self.law.stribeck + stribeck <= 0.0):
            return NONE
        return float(values @ normal @ values + 2.0 * values @ gradient)


def _solved(normal: Array, gradient: Array) -> Array:
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = normal / np.outer(size, size) + RIDGE * np.eye(len(size))
    return -np.linalg.solve(scaled, gradient / size) / size


def _least(cost: Callable[[Array], float], start: Array) -> Array:
    """Where a cost is least near a start."""
    simplex = np.vstack([start, start + 0.2 * np.eye(len(start))])
    options = {"initial_simplex": simplex, "xatol": CLOSE, "fatol": np.inf, "maxfev": 200}
    found = minimize(cost, start, method="Nelder-Mead", options=options)
    return np.asarray(found.x if found.fun < NONE else start)


def rounded(value: float) -> float:
    """A width or speed with as many digits as are worth it."""
    return float(f"{value:.{DIGITS}g}")
