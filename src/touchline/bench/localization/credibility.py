# SPDX-License-Identifier: Apache-2.0
"""How large a credible region must be to hold the truth: calibrated if uniform over many runs.

A posterior is a mixture over places, each normal along its surface. The highest-posterior region
that just holds the truth has the probability of all that is denser than the truth. A 90 % region
holds the truth if this level is below 0.9; over many runs that must be so in 90 % of them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array
from touchline.result.contact import Contact

DRAWS = 2000
LEAST_STD = 1e-6  # m; a sharper posterior is not meant


def mixture_level(
    weights: Array,
    means: Array,
    covariances: Array,
    kinds: Sequence[str],
    place: Array,
    kind: str,
    draws: int = DRAWS,
) -> float:
    """Level of the highest-posterior region of a mixture that just holds a place, 0 to 1.

    Args:
        weights: (m,) of the components, summing to one.
        means: (m, 3) [m].
        covariances: (m, 3, 3) [m2], of rank two: along the surface.
        kinds: (m,) the rigid body of each component; places on other bodies do not meet.
        place: (3,) [m].
        kind: the body of the place.
        draws: how many samples stand for the mixture.
    """
    frames, stds = zip(*(_principal(c) for c in covariances), strict=True)

    def density(points: Array, names: NDArray) -> Array:
        total = np.zeros(len(points))
        for w, mean, E, s, name in zip(weights, means, frames, stds, kinds, strict=True):
            z = (points - mean) @ E / s
            total += w * np.exp(-0.5 * (z * z).sum(axis=1)) / (s[0] * s[1]) * (names == name)
        return total

    chance = np.random.default_rng(0)
    which = chance.choice(len(weights), draws, p=np.asarray(weights) / np.sum(weights))
    normal = chance.normal(size=(draws, 2))
    E, s = np.array(frames)[which], np.array(stds)[which]
    points = np.asarray(means)[which] + np.einsum("nij,nj->ni", E, s * normal)
    here = density(np.asarray(place)[None], np.array([kind]))[0]
    return float(np.mean(density(points, np.array(list(kinds))[which]) > here))


def credibility(answer: Contact, body: str, place: Array) -> float:
    """Level of the region of an answer that just holds a place (3,) [m] on a body.

    Every candidate has the covariance of the best one, which is all that an answer tells.
    """
    if answer.covariance is None or not answer.candidates:
        return float("nan")
    weights = np.array([k.probability for k in answer.candidates])
    means = np.array([k.position for k in answer.candidates])
    covariances = np.repeat(answer.covariance[None], len(weights), axis=0)
    kinds = [k.body for k in answer.candidates]
    return mixture_level(weights, means, covariances, kinds, place, body)


def _principal(covariance: Array) -> tuple[Array, Array]:
    """The two directions (3, 2) along the surface and the standard deviations (2,) there."""
    values, vectors = np.linalg.eigh(covariance)
    return vectors[:, 1:], np.sqrt(np.maximum(values[1:], LEAST_STD**2))
