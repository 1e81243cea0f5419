# SPDX-License-Identifier: Apache-2.0
"""Does a single moment of the recordings set a threshold?

A short recording tells rare alarms by the few largest excursions. A robot that stopped hard once,
or was struck, then has a threshold that ordinary motion never comes near.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.detector.calibration import Statistics
from touchline.detector.tail import LEAST_PEAKS, Tail, fit_tail
from touchline.model.values import METHODS

# Times the threshold without the moment. With an exponential tail the largest peak of a minute
# makes 1.15 of it in the median, over 1.6 in one of 300; that of five minutes never 1.5.
MUCH = 1.6


@dataclass(frozen=True)
class OneMoment:
    """The moment without which a threshold would be much lower.

    Attributes:
        recording: its number.
        time: when the largest excursion was [s].
        segment, method: of the threshold.
        threshold, without: with the moment and without it.
    """

    recording: int
    time: float
    segment: str
    method: str
    threshold: float
    without: float


def find_moments(
    found: Statistics,
    segments: Sequence[str],
    tails: dict[str, dict[str, Tail]],
    methods: tuple[str, ...],
    share: float,
) -> list[OneMoment]:
    """Thresholds of methods in use that one moment sets.

    Args:
        found: statistics of all methods.
        segments: their names, in the order of the statistics.
        tails: fitted to the statistics, by segment and method.
        methods: in use.
        share: alarms per hour of each method on each segment.
    """
    moments = []
    for g, segment in enumerate(segments):
        of = tails.get(segment, {})
        for method in (m for m in methods if m in of):
            series = found.blocks[:, g, METHODS.index(method)]
            at = int(np.nanargmax(series))
            rest = fit_tail(_without(series, at, found.gap), found.hours, found.gap, LEAST_PEAKS)
            whole = of[method].threshold(share)
            less = np.inf if rest is None else rest.threshold(share)
            if whole > MUCH * less:
                number, time = int(found.recording[at]), float(found.time[at])
                moments.append(OneMoment(number, time, segment, method, whole, less))
    return moments


def _without(series: Array, at: int, gap: int) -> Array:
    """The statistic without the alarm of its largest value: all near it above half of that."""
    high = np.flatnonzero(series > 0.5 * series[at])
    parts = np.split(high, np.flatnonzero(np.diff(high) > gap) + 1)
    own = next(part for part in parts if at in part)
    rest = series.copy()
    rest[max(own[0] - gap, 0) : own[-1] + gap + 1] = np.nan
    return rest
