# SPDX-License-Identifier: Apache-2.0
"""The white noise of signals, beneath whatever motion they show."""

from math import comb

import numpy as np

from touchline.arrays import Array

ORDER = 3  # of the differences: they take out what is smooth over four samples
FAR = 8.0  # differences so many robust sigmas out are jumps, not noise


class NoiseMeter:
    """Sums up the squared differences of a signal (N, columns), part by part."""

    def __init__(self, columns: int) -> None:
        self._sum, self._count = np.zeros(columns), np.zeros(columns)

    def add(self, values: Array) -> None:
        """Takes the next evenly sampled rows; NaN where nothing was measured."""
        if len(values) <= ORDER:
            return
        d = np.diff(np.where(np.isfinite(values), values, np.nan), ORDER, axis=0)
        known = np.isfinite(d)
        with np.errstate(over="ignore"):  # readings beyond all reason have an infinite noise
            squares = np.where(known, d, 0.0) ** 2
        for j in np.flatnonzero(known.any(axis=0)):
            own = squares[known[:, j], j]
            typical = float(np.median(own)) / 0.455  # of the square of a normal variable
            near = own <= FAR**2 * typical if typical > 0 else np.ones(len(own), bool)
            self._sum[j] += own[near].sum()
            self._count[j] += near.sum()

    def sigma(self) -> Array:
        """1 sigma per sample (columns,); NaN where there was no signal.

        A difference of order d of white noise has the variance sigma^2 times binom(2 d, d).
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.sqrt(self._sum / self._count / comb(2 * ORDER, ORDER))
