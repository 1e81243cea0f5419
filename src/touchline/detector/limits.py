# SPDX-License-Identifier: Apache-2.0
"""Limits of a statistic for a false-alarm rate: from theory, and from the tail that was seen."""

import math

import numpy as np

from touchline.arrays import Array, Index
from touchline.detector.chi_square import chi_square_limit, normal_limit
from touchline.model.description import DetectionDescription, TailDescription
from touchline.tuning import DEFAULTS

CUSUM_SHIFT = DEFAULTS["detector.cusum_shift"]


def threshold(tail: TailDescription, rate: float) -> float:
    """What the tail's statistic exceeds `rate` times an hour; its beginning where that is more."""
    excess = np.log(max(tail.per_hour / rate, 1.0))
    if abs(tail.shape) > 1e-9:
        excess = np.expm1(tail.shape * excess) / tail.shape
    return float(tail.level + tail.scale * excess)


def siegmund(run_length: float, shift: float) -> float:
    """Threshold of a one-sided CUSUM on standard normal samples.

    Args:
        run_length: mean number of samples to a false alarm.
        shift: of the mean that it is made for; half of it is taken off each sample.

    The corrected diffusion approximation (Siegmund 1985): with b = h + 1.166 and k = shift / 2 the
    run length is (exp(2 k b) - 2 k b - 1) / (2 k^2).
    """
    least, most = 0.0, (np.log1p(0.5 * shift**2 * run_length) + 10.0) / shift + 10.0
    for _ in range(60):  # bisection: the run length grows with b
        b = 0.5 * (least + most)
        longer = np.expm1(shift * b) - shift * b > 0.5 * shift**2 * run_length
        least, most = (least, b) if longer else (b, most)
    return max(least - 1.166, 0.0)


def theoretical(
    method: str, counts: Index, rate: float, period: float, d: DetectionDescription
) -> Array:
    """Limits (m,) if noise were all: every sample is taken for a test of its own."""
    if method == "rows":
        return np.ones(len(counts))
    alarm = min(rate * period / 3600.0, 0.1)
    rows = np.maximum(counts, 1)
    if method == "scaled":
        return normal_limit(0.5 * alarm / rows)
    if method == "cusum":
        return np.array([siegmund(2 * n / alarm, CUSUM_SHIFT) for n in rows])
    tests = len(d.windows) if method == "glrt" else 1
    return np.sqrt(chi_square_limit(rows, alarm / tests))


def sum_limits(counts: Index, sigmas: float) -> Array:
    """Limits (m,) of the sum of squared rows, as rare as one row beyond `sigmas`."""
    alarm = math.erfc(sigmas / math.sqrt(2))  # of one row: a normal variable beyond +-sigmas
    return chi_square_limit(np.maximum(counts, 1), alarm) / sigmas**2
