# SPDX-License-Identifier: Apache-2.0
"""The line of force action of a wrench, and whether one force alone can make it."""

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array


def line_point(wrench: ArrayLike) -> Array:
    """The point (3,) [m] of the line of force action nearest to the origin (eq. 19).

    Args:
        wrench: (..., 6) [N, Nm]; the moment about the origin in which the point is wanted.
    """
    w = np.asarray(wrench, float)
    force, moment = w[..., :3], w[..., 3:]
    return np.cross(force, moment) / np.sum(force * force, axis=-1, keepdims=True)


def line_at(wrench: ArrayLike, alpha: ArrayLike) -> Array:
    """Points (..., 3) [m] of the line `alpha` [m] along the force from `line_point` (eq. 20)."""
    force = np.asarray(wrench, float)[..., :3]
    unit = force / np.linalg.norm(force, axis=-1, keepdims=True)
    return line_point(wrench) + np.asarray(alpha, float)[..., None] * unit


def pitch(wrench: ArrayLike) -> Array:
    """The product f . m [N Nm] of wrenches (..., 6): zero for one pure force."""
    w = np.asarray(wrench, float)
    return np.sum(w[..., :3] * w[..., 3:], axis=-1)


def pitch_score(wrench: ArrayLike, covariance: ArrayLike) -> Array:
    """The pitch in standard deviations: a standard normal variable for one pure force.

    A large one means a contact moment or more than one contact.

    Args:
        wrench: (..., 6) [N, Nm].
        covariance: (..., 6, 6) of it; force and moment are correlated about any point but the
            sensor's own.
    """
    w = np.asarray(wrench, float)
    gradient = np.concatenate([w[..., 3:], w[..., :3]], axis=-1)
    variance = np.einsum("...i,...ij,...j->...", gradient, np.asarray(covariance, float), gradient)
    return pitch(w) / np.sqrt(variance)
