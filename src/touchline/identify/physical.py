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
_ROWS = np.concatenate([np.arange(4), _LOWER[0]])  # where each of the ten numbers stands in T
_COLUMNS = np.concatenate([np.arange(4), _LOWER[1]])


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
        L = self._root @ _triangle(step)
        size = np.ones(PARAMETERS)
        size[:4] = np.exp(np.clip(step[:4], -3.0, 3.0))
        halves = self._root[:, _ROWS].T[:, :, None] * L[:, _COLUMNS].T[:, None, :]
        changes = size[:, None, None] * (halves + np.swapaxes(halves, 1, 2))
        return _VECTOR @ changes.reshape(PARAMETERS, -1).T


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
    return _VECTOR @ P.ravel()


def _vector_of_entries() -> Array:
    """The ten parameters as a linear function (10, 16) of the entries of a pseudo-inertia."""
    columns = []
    for entry in np.eye(16).reshape(16, 4, 4):
        inertia = np.trace(entry[:3, :3]) * np.eye(3) - entry[:3, :3]
        columns.append(np.concatenate([[entry[3, 3]], entry[:3, 3], inertia[np.triu_indices(3)]]))
    return np.column_stack(columns)


_VECTOR = _vector_of_entries()
