# SPDX-License-Identifier: Apache-2.0
"""Odd functions of a joint's speed as sums of a few: any law of dry friction, filtered beforehand.

A filter is linear. So what it makes of a law is the law at some speeds, times what the filter makes
of the functions that interpolate between these speeds: cubic ones of the logarithm of speed.
"""

import numpy as np

from touchline.arrays import Array

SLOWEST, STEP, COUNT = 1e-3, 1.2, 47  # rad/s, ratio: laws are off by 0.001 of them at most
SPEEDS: Array = SLOWEST * STEP ** np.arange(COUNT, dtype=np.float64)  # (K,) up to 4.4 rad/s
_POINTS = 4  # of a cubic


def spread(qd: Array) -> Array:
    """The functions (..., K) at speeds (...): linear below the slowest, constant past the fastest.

    `spread(qd) @ law(SPEEDS)` is about `law(qd)` of an odd law.
    """
    size = np.abs(qd)
    place = np.log(np.clip(size, SPEEDS[0], SPEEDS[-1]) / SLOWEST) / np.log(STEP)
    first = np.clip(np.floor(place).astype(np.int64) - 1, 0, COUNT - _POINTS)
    at = place - first
    weights = np.ones((*qd.shape, _POINTS))
    for i in range(_POINTS):
        for j in range(_POINTS):
            if i != j:
                weights[..., i] *= (at - j) / (i - j)
    out = np.zeros((*qd.shape, COUNT))
    index = first[..., None] + np.arange(_POINTS)
    np.put_along_axis(out, index, weights, axis=-1)
    return out * (np.sign(qd) * np.minimum(size / SLOWEST, 1.0))[..., None]
