# SPDX-License-Identifier: Apache-2.0
"""Curves for plots: the least and the largest value in each of many equal pieces of time.

The pieces widen as the recording goes on, so that memory does not grow with its length.
"""

import numpy as np

from touchline.arrays import Array, Mask

ROUNDING = 1e-3  # of a piece, at first
ASTRAY = 1.0  # s; a stamp that is further ahead of a later one is wrong


class Traces:
    """Minimum and maximum of `columns` signals over at most `buckets` pieces of time.

    Attributes:
        start: time at which the first piece begins [s].
        width: of a piece [s].
        low: (buckets, columns) smallest values; NaN where a piece holds no sample.
        high: (buckets, columns) largest values.
    """

    def __init__(self, columns: int, buckets: int, width: float) -> None:
        if buckets % 2:
            raise ValueError(f"buckets is {buckets}, but must be even")
        self.start = np.nan
        self.width = width
        self._early = ROUNDING * width
        self.low = np.full((buckets, columns), np.nan)
        self.high = np.full((buckets, columns), np.nan)

    def add(self, time: Array, values: Array) -> None:
        """Take N samples: `time` (N,) [s] and `values` (N, columns). Only forward time counts."""
        usable = _credible(time)
        if not usable.all():
            time, values = time[usable], values[usable]
        if not len(time):
            return
        if np.isnan(self.start):
            self.start = float(time[0])
        ahead = time >= self.start
        if not ahead.all():
            time, values = time[ahead], values[ahead]
        if not len(time):
            return
        self._make_room(float(time.max()))
        # Pieces as wide as the period hold one sample each, whatever the rounding of the stamps.
        index = ((time - self.start + self._early) / self.width).astype(int)
        if (np.diff(index) < 0).any():
            order = np.argsort(index, kind="stable")
            index, values = index[order], values[order]
        begins = np.flatnonzero(np.diff(index, prepend=-1))
        where = index[begins]
        self.low[where] = np.fmin(self.low[where], np.fmin.reduceat(values, begins, axis=0))
        self.high[where] = np.fmax(self.high[where], np.fmax.reduceat(values, begins, axis=0))

    def _make_room(self, last: float) -> None:
        while last - self.start + self._early >= self.width * len(self.low):
            half = len(self.low) // 2
            for array, merge in ((self.low, np.fmin), (self.high, np.fmax)):
                array[:half] = merge(array[0::2], array[1::2])
                array[half:] = np.nan
            self.width *= 2

    @property
    def used(self) -> int:
        """Number of pieces up to the last one with a sample."""
        filled = np.flatnonzero(np.isfinite(self.low).any(axis=1))
        return int(filled[-1]) + 1 if len(filled) else 0


def _credible(time: Array) -> Mask:
    """Stamps that are numbers and do not run far ahead of those that follow them."""
    usable = np.isfinite(time)
    if usable.all() and (np.diff(time) >= 0).all():
        return usable
    following = np.minimum.accumulate(np.where(usable, time, np.inf)[::-1])[::-1]
    astray = usable & (time > following + ASTRAY)
    return usable if astray.sum() > len(time) / 10 else usable & ~astray
