# SPDX-License-Identifier: Apache-2.0
"""Was a recording that shall be free of contacts really free of them?"""

from dataclasses import dataclass

import numpy as np

from touchline.contact.calibration import BLOCK, GAP, Statistics
from touchline.contact.tail import cluster_peaks

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
    gap = round(GAP / BLOCK)
    suspicions: dict[tuple[int, float], Suspicion] = {}
    for g in range(found.blocks.shape[1]):
        for t, method in enumerate(methods):
            if method not in METHODS:
                continue
            series = found.blocks[:, g, t]
            limit = _limit(series[np.isfinite(series)])
            if limit is None:
                continue
            peaks, at = cluster_peaks(series, limit, gap)
            for peak, i in zip(peaks, at.tolist(), strict=True):
                start, end = _extent(series, i, 0.5 * limit)
                key = int(found.recording[i]), round(float(found.time[i]), 0)
                new = Suspicion(
                    key[0],
                    float(found.time[start]),
                    float(found.time[end]) + BLOCK,
                    g,
                    float(peak / limit),
                )
                old = suspicions.get(key)
                if old is None or old.factor < new.factor:
                    suspicions[key] = new
    return [suspicions[key] for key in sorted(suspicions)]


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
