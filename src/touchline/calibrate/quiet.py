# SPDX-License-Identifier: Apache-2.0
"""Was a recording that shall be free of contacts really free of them?"""

from dataclasses import dataclass, replace

import numpy as np

from touchline.detector.calibration import Statistics
from touchline.detector.tail import cluster_peaks

SUSPICIOUS = 3.0, 5.0  # excesses beyond 3 (ln n + 5) scales of a tail belong to no such tail
FEW = 8  # peaks that a judgement needs
METHODS = ("scaled", "chi2", "glrt")
LISTED = 5


@dataclass(frozen=True)
class Suspicion:
    """A stretch of a recording in which something seems to touch the robot.

    Attributes:
        recording: its number.
        start, end: [s].
        segment: number of the segment.
        factor: largest statistic in units of the largest that the rest lets expect.
    """

    recording: int
    start: float
    end: float
    segment: int
    factor: float


def find_contacts(found: Statistics, methods: tuple[str, ...]) -> list[Suspicion]:
    """Peaks that are far beyond the tail of the others, in order of time.

    It sees what stands out. A contact that is as weak as the errors of the model, or that lasts for
    most of a recording, does not.
    """
    suspicions: list[Suspicion] = []
    for g in range(found.blocks.shape[1]):
        for t, method in enumerate(methods):
            if method not in METHODS:
                continue
            series = found.blocks[:, g, t]
            limit = _limit(series[np.isfinite(series)])
            if limit is None:
                continue
            peaks, at = cluster_peaks(series, limit, found.gap)
            for peak, i in zip(peaks, at.tolist(), strict=True):
                start, end = (float(found.time[k]) for k in _extent(series, i, 0.5 * limit))
                number, factor = int(found.recording[i]), float(peak / limit)
                suspicions.append(Suspicion(number, start, end + found.length, g, factor))
    return _merged(suspicions)


def _merged(suspicions: list[Suspicion]) -> list[Suspicion]:
    """Those that overlap as one, with the segment that stands out most, in order of time."""
    merged: list[Suspicion] = []
    for new in sorted(suspicions, key=lambda s: (s.recording, s.start)):
        old = merged[-1] if merged else None
        if old is None or old.recording != new.recording or old.end < new.start:
            merged.append(new)
            continue
        worse = max(old, new, key=lambda s: s.factor)
        merged[-1] = replace(worse, start=old.start, end=max(old.end, new.end))
    return merged


def _limit(series: np.ndarray) -> float | None:
    """What no peak of a tail like that of most blocks exceeds."""
    if len(series) < 20 * FEW or series.max() <= 0:
        return None
    level = float(np.quantile(series, 0.9))
    excess = series[series > level] - level
    if len(excess) < FEW:
        return None
    # Most of the blocks tell the scale: contacts are the larger ones of the excesses.
    scale = float(np.quantile(excess, 0.5)) / np.log(2.0)
    times, more = SUSPICIOUS
    return level + times * scale * (np.log(len(excess)) + more)


def _extent(series: np.ndarray, at: int, level: float) -> tuple[int, int]:
    start = end = at
    while start > 0 and series[start - 1] > level:
        start -= 1
    while end + 1 < len(series) and series[end + 1] > level:
        end += 1
    return start, end
