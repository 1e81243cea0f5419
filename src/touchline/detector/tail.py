# SPDX-License-Identifier: Apache-2.0
"""Extreme values: how often a statistic exceeds what, also beyond what has been seen.

Peaks over a threshold (Davison and Smith 1990): clusters of exceedances are rare and independent,
and their excesses have a generalized Pareto distribution.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array, Index
from touchline.model.description import TailDescription

PEAKS, PEAKS_PER_HOUR = 50, 60.0  # the tail begins where there are so many
LEAST_PEAKS = 20
SHAPES = -0.5, 0.5  # allowed; beyond them estimates make no sense
SHAPE_SIGMA = 0.2  # of the prior: shapes of noise and of sums of many errors are near 0
Z95 = 1.96


@dataclass(frozen=True)
class Tail:
    """A generalized Pareto tail of the peaks of a statistic.

    Attributes:
        level: where it begins; exceeded `per_hour` times an hour.
        per_hour: rate of the peaks above `level`.
        scale, shape: of the excesses.
        count: number of peaks that it comes from.
        hours: in which they were seen.
    """

    level: float
    per_hour: float
    scale: float
    shape: float
    count: int
    hours: float

    def threshold(self, rate: float) -> float:
        """What is exceeded `rate` times an hour; `level` where that is more often."""
        return self.level + self.scale * _excess(np.log(max(self.per_hour / rate, 1.0)), self.shape)

    def rate(self, value: ArrayLike) -> Array:
        """How often an hour `value` is exceeded; `per_hour` for values below `level`."""
        x = np.maximum((np.asarray(value, float) - self.level) / self.scale, 0.0)
        if abs(self.shape) < 1e-9:
            return self.per_hour * np.exp(-x)
        inside = np.maximum(1.0 + self.shape * x, 0.0)
        with np.errstate(divide="ignore"):
            return self.per_hour * np.where(inside > 0, inside ** (-1.0 / self.shape), 0.0)

    def interval(self, rate: float) -> tuple[float, float]:
        """95 % interval of `threshold(rate)`, from the scatter of count, scale and shape.

        The asymptotic covariance of the likelihood estimates (Smith 1987), in first order.
        """
        t, n = np.log(max(self.per_hour / rate, 1.0)), self.count
        step = 1e-4
        by_shape = self.scale * (_excess(t, self.shape + step) - _excess(t, self.shape - step))
        by_shape /= 2 * step
        by_scale = _excess(t, self.shape)
        by_count = self.scale * np.exp(self.shape * t)  # of the logarithm of per_hour
        a = 1.0 + self.shape
        variance = by_shape**2 * a**2 + by_scale**2 * 2 * a * self.scale**2
        variance += -2 * by_shape * by_scale * a * self.scale + by_count**2
        off = Z95 * np.sqrt(max(variance, 0.0) / n)
        middle = self.threshold(rate)
        return max(middle - off, self.level), middle + off

    def extrapolates(self, rate: float) -> bool:
        """Does `threshold(rate)` lie beyond what the recording can show?"""
        return rate * self.hours < 1.0

    def description(self) -> TailDescription:
        """As it stands in `robot.yaml`."""
        return TailDescription(
            float(f"{self.level:.5g}"),
            float(f"{self.per_hour:.5g}"),
            float(f"{self.scale:.5g}"),
            float(f"{self.shape:.4g}"),
        )


def _excess(t: float, shape: float) -> float:
    return float(t if abs(shape) < 1e-9 else np.expm1(shape * t) / shape)


def cluster_peaks(series: Array, level: float, gap: int) -> tuple[Array, Index]:
    """Peaks (P,) of the clusters above `level`, and where they are.

    Args:
        series: (N,) a statistic; NaN where it is not known.
        level: of exceedance.
        gap: exceedances at most so many values apart belong together; 0: each stands alone.
    """
    above = np.flatnonzero(series > level)
    if not len(above):
        return np.zeros(0), above
    first = np.flatnonzero(np.diff(above, prepend=above[0] - gap - 1) > gap)
    peaks = np.maximum.reduceat(series[above], first)
    groups = np.split(above, first[1:])
    at = np.array([group[np.argmax(series[group])] for group in groups])
    return peaks, at


def count_clusters(series: Array, level: float, gap: int) -> int:
    """How many clusters `cluster_peaks` finds."""
    above = np.flatnonzero(series > level)
    return int((np.diff(above) > gap).sum()) + 1 if len(above) else 0


def alarm_levels(series: Array, gap: int) -> Array:
    """The thresholds (L,) below which there is one more alarm, the largest first.

    The first k of them take the place of the k largest peaks: below the k-th of them
    `count_clusters` finds k. Peaks of clusters at any one level would not do, since a cluster that
    lasts has several peaks that are alarms of their own further up.

    Args:
        series: (N,) a statistic; NaN where it is not known.
        gap: see `cluster_peaks`.
    """
    known = np.isfinite(series)
    if not known.any():
        return np.zeros(0)
    if gap == 0:
        return np.sort(series[known])[::-1]
    from scipy.ndimage import grey_closing

    least = float(series[known].min())
    # Valleys that are too short to part two alarms are filled.
    x = grey_closing(np.where(known, series, least), size=gap)
    x = np.concatenate([[least], x[np.flatnonzero(np.diff(x, prepend=least))], [least]])
    rises = np.diff(x) > 0
    peaks, valleys = x[1:-1][rises[:-1] & ~rises[1:]], x[1:-1][~rises[:-1] & rises[1:]]
    # Above u there are as many parts as peaks, less the valleys between them.
    values = np.concatenate([valleys, peaks])
    steps = np.repeat([-1, 1], [len(valleys), len(peaks)])
    order = np.argsort(-values, kind="stable")
    alarms = np.maximum.accumulate(np.cumsum(steps[order]))
    return values[order][np.flatnonzero(np.diff(alarms, prepend=0) > 0)]


def fit_tail(series: Array, hours: float, gap: int, least: int = LEAST_PEAKS) -> Tail | None:
    """The tail of a statistic.

    Args:
        series: (N,) the statistic, or its maxima over short blocks.
        hours: that it covers.
        gap: see `cluster_peaks`.
        least: alarms that it takes.

    Returns:
        None where there are fewer.
    """
    levels = alarm_levels(series, gap)
    levels = levels[levels > np.nanmedian(series)] if len(levels) else levels
    count = min(round(max(PEAKS, PEAKS_PER_HOUR * hours)), len(levels) - 1)
    if count < least or levels[0] <= levels[count]:
        return None
    scale, shape = fit_excess(levels[:count] - levels[count])
    return Tail(float(levels[count]), count / hours, scale, shape, count, hours)


def fit_excess(excess: Array) -> tuple[float, float]:
    """Scale and shape of a generalized Pareto distribution: its most probable ones.

    The shape has a weak prior about 0, which counts where there are few peaks. The likelihood is
    profiled over theta = shape / scale (Grimshaw 1993); the shape is kept within `SHAPES`.
    """
    x = np.asarray(excess, dtype=float)
    mean, largest = float(x.mean()), float(x.max())

    def shape_of(theta: float) -> float:
        return float(np.log1p(theta * x).mean())

    def loss(theta: float) -> float:
        if abs(theta) * mean < 1e-7:
            return 1.0 + np.log(mean)
        k = shape_of(theta)
        if not SHAPES[0] <= k <= SHAPES[1] or k / theta <= 0:
            return np.inf
        return np.log(k / theta) + 1.0 + k + 0.5 * (k / SHAPE_SIGMA) ** 2 / len(x)

    grid = np.concatenate(
        [
            -np.geomspace(1e-4, 0.999, 200)[::-1] / largest,
            [0.0],
            np.geomspace(1e-4, 5.0, 200) / mean,
        ]
    )
    best = grid[int(np.argmin([loss(theta) for theta in grid]))]
    if abs(best) * mean < 1e-7:
        return mean, 0.0
    shape = shape_of(best)
    return shape / best, shape


def poisson_interval(count: int, confidence: float = 0.95) -> tuple[float, float]:
    """Exact interval of the mean of a Poisson variable that turned out to be `count`."""
    from scipy.special import chdtri

    tail = 0.5 * (1.0 - confidence)
    low = 0.5 * chdtri(2 * count, 1.0 - tail) if count else 0.0
    return float(low), float(0.5 * chdtri(2 * (count + 1), tail))
