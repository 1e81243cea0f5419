# SPDX-License-Identifier: Apache-2.0
"""Limits of normal and chi-squared variables, by the closed forms for whole degrees of freedom."""

import math
from collections.abc import Iterable
from functools import lru_cache
from statistics import NormalDist

import numpy as np

from touchline.arrays import Array

STEPS = 200  # of the bisection, which ends at the last bit


def beyond(x: float, degrees: int) -> float:
    """Probability that a chi-squared variable with these degrees of freedom exceeds `x`.

    Q(k/2, x/2) of the regularized incomplete gamma function (Abramowitz and Stegun, 26.4.4 and
    26.4.5): sums of positive terms, exact to rounding also far out in the tail.
    """
    half, odd = 0.5 * x, degrees % 2
    total = math.erfc(math.sqrt(half)) if odd else 0.0
    power = 0.5 if odd else 0.0
    log_term = power * math.log(half) - math.lgamma(power + 1.0) - half if half > 0.0 else -math.inf
    if half == 0.0:
        return 1.0
    while power < 0.5 * degrees - 0.25:
        total += math.exp(log_term)
        power += 1.0
        log_term += math.log(half / power)
    return min(total, 1.0)


def chi_square_limit(degrees: Iterable[int], probability: float | Array) -> Array:
    """What chi-squared variables exceed with a probability, for each of the degrees of freedom."""
    degrees = [int(k) for k in degrees]
    wanted = np.broadcast_to(probability, len(degrees))
    return np.array([_limit(k, float(p)) for k, p in zip(degrees, wanted, strict=True)])


def normal_limit(probability: Array) -> Array:
    """What a standard normal variable exceeds with a probability."""
    normal = NormalDist()
    return np.array([-normal.inv_cdf(float(p)) for p in np.ravel(probability)])


@lru_cache(maxsize=256)  # many rows of many pipelines ask for the same few
def _limit(degrees: int, probability: float) -> float:
    low, high = 0.0, 2.0 * degrees
    while beyond(high, degrees) > probability:
        high *= 2.0
    for _ in range(STEPS):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        low, high = (middle, high) if beyond(middle, degrees) > probability else (low, middle)
    return 0.5 * (low + high)
