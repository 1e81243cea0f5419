# SPDX-License-Identifier: Apache-2.0
"""Means of neighbouring samples: a fast recording at a pace that suffices for weights."""

from collections.abc import Iterable, Iterator

import numpy as np

from touchline.logs.period import typical_period
from touchline.observer.samples import Samples

LONGER = 2.0  # times its usual length; a block that lasts longer bridges a gap and is left out


def averaged(parts: Iterable[Samples], rate: float) -> Iterator[Samples]:
    """The samples as means over blocks; as they are where no two of them fit into one.

    A value that is not finite is left out of its mean; NaN where a block has none. Blocks whose
    stamps do not rise, or that bridge a gap, are left out, and so is what is left over of a part.

    Args:
        parts: of a recording.
        rate: of the blocks, at least [Hz].
    """
    count = 0
    period = 0.0
    for part in parts:
        if not count:
            period = typical_period(part.time)
            count = max(1, int(1.0 / (rate * period))) if period > 0.0 else 1
        if count == 1:
            yield part
            continue
        blocks = len(part) // count
        time = part.time[: blocks * count].reshape(blocks, count)
        with np.errstate(invalid="ignore"):
            rising = (np.diff(time, axis=1) > 0.0).all(axis=1)
            short = time[:, -1] - time[:, 0] <= LONGER * count * period
        keep = rising & short
        signals = (part.q, part.qd, part.tau, part.wrench)
        q, qd, tau, wrench = (_means(values, count)[keep] for values in signals)
        yield Samples(time[keep].mean(axis=1), q, qd, tau, wrench, part.row)


def _means(values: np.ndarray, count: int) -> np.ndarray:
    """Means (N // count, ...) of `count` rows (N, ...) each, of what is finite."""
    blocks = len(values) // count
    split = values[: blocks * count].reshape(blocks, count, *values.shape[1:])
    there = np.isfinite(split)
    number = there.sum(axis=1)
    total = np.where(there, split, 0.0).sum(axis=1)
    return np.where(number > 0, total / np.maximum(number, 1), np.nan)
