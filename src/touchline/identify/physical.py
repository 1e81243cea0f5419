# SPDX-License-Identifier: Apache-2.0
"""Inertial parameters that some body can have: log-Cholesky steps from the model's own.

A body is possible where its pseudo-inertia, the second moments of its density over (x, 1), is
positive definite (Wensing, Kim, Slotine, IEEE RA-L 3(1), 2018):

    P = [[tr(I)/2 1 - I, m c], [(m c)^T, m]] = L0 T T^T L0^T

with L0 the model's Cholesky factor and T lower triangular, its diagonal exponentials (Rucker and
Wensing, IEEE RA-L 7(2), 2022). T = 1 is the model. A step of size s changes masses and moments by
about 2 s of themselves, and centres by s of the body's radius of gyration.
"""

import numpy as np

from touchline.arrays import Array
from touchline.identify.regressor import PARAMETERS

LEAST_RADIUS = 0.005  # m; bodies are taken as at least so wide about their centre
_LOWER = np.tril_indices(4, -1)


class PhysicalBody:
    """The ten parameters of one body as a function of ten free numbers, zero at the model's.

    Args:
        vector: (10,) the model's parameters; its mass is positive.
        added: the model lacks the body; a change is then all of it.
    """

    def __init__(self, vector: Array, added: bool = False) -> None:
        self.model = vector
        P = pseudo_inertia(vector)
        mass, centre = vector[0], vector[1:4] / vector[0]
        spread = P[:3, :3] - mass * np.outer(centre, centre)
        values, axes = np.linalg.eigh(0.5 * (spread + spread.T))
        floor = mass * LEAST_RADIUS**2
        mended = axes @ np.diag(np.maximum(values, floor)) @ axes.T
        P[:3, :3] = mended + mass * np.outer(centre, centre)
        self._root = np.linalg.cholesky(P)
        self._start = np.zeros(PARAMETERS) if added else vector_of_pseudo(P)

    def change(self, step: Array) -> Array:
        """What a step (10,) adds to the parameters."""
        L = self._root @ _triangle(step)
        return vector_of_pseudo(L @ L.T) - self._start

    def jacobian(self, step: Array) -> Array:
        """Derivatives (10, 10) of the parameters with respect to the step."""
        T = _triangle(step)
        columns = []
        for i in range(PARAMETERS):
            dT = np.zeros((4, 4))
            if i < 4:
                dT[i, i] = T[i, i]
            else:
                dT[_LOWER[0][i - 4], _LOWER[1][i - 4]] = 1.0
            half = self._root @ dT @ T.T @ self._root.T
            columns.append(vector_of_pseudo(half + half.T))
        return np.column_stack(columns)


def _triangle(step: Array) -> Array:
    T = np.diag(np.exp(np.clip(step[:4], -3.0, 3.0)))
    T[_LOWER] = step[4:]
    return T


def pseudo_inertia(vector: Array) -> Array:
    """The pseudo-inertia (4, 4) of ten parameters."""
    xx, xy, xz, yy, yz, zz = vector[4:]
    inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    P = np.empty((4, 4))
    P[:3, :3] = 0.5 * np.trace(inertia) * np.eye(3) - inertia
    P[:3, 3] = P[3, :3] = vector[1:4]
    P[3, 3] = vector[0]
    return P


def vector_of_pseudo(P: Array) -> Array:
    """The ten parameters of a pseudo-inertia (4, 4)."""
    inertia = np.trace(P[:3, :3]) * np.eye(3) - P[:3, :3]
    return np.concatenate([[P[3, 3]], P[:3, 3], inertia[np.triu_indices(3)]])
