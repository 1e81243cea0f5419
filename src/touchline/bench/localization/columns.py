# SPDX-License-Identifier: Apache-2.0
"""What the tables of the localization benchmark say of a number of touches."""

from collections.abc import Sequence

import numpy as np

from touchline.arrays import Array
from touchline.bench.localization.touched import GROSS, NEAR, Touched
from touchline.bench.tables import Row

TOUCHES: Row = (
    "body", "> 10 cm", "median", "p99", "RMS", "RMS found", "lag", "force", "90 % holds", "unsure",
    "us",
)  # fmt: skip


def touch_columns(touches: Sequence[Touched], time: float) -> Row:
    """The columns `TOUCHES`; `time` [s] is that of an update."""
    error = np.array([touch.error for touch in touches])
    known = error[np.isfinite(error)]
    level = np.array([touch.level for touch in touches])
    force = rms(np.array([touch.force_error for touch in touches]))
    return (
        percent(np.mean([touch.found_body == touch.body for touch in touches])),
        percent(np.mean(error > GROSS)),
        *(millimetres(np.percentile(known, p) if len(known) else np.nan) for p in (50, 99)),
        millimetres(rms(known)),
        millimetres(rms(known[known < NEAR])),
        _lag(np.array([touch.lag for touch in touches])),
        f"{force:.3f}" if np.isfinite(force) else "-",
        percent(np.mean(level[np.isfinite(level)] < 0.9)) if np.isfinite(level).any() else "-",
        percent(np.mean([touch.status != "located" for touch in touches])),
        f"{1e6 * time:.0f}" if np.isfinite(time) else "-",
    )


def rate_columns(good: int, of: int) -> Row:
    """A rate and its 95 % score interval."""
    low, high = wilson(good, of)
    return percent(good / of), f"{100 * low:.2f}-{100 * high:.2f}"


def wilson(good: int, of: int, z: float = 1.959964) -> tuple[float, float]:
    """95 % score interval of a rate (Wilson 1927)."""
    if of == 0:
        return 0.0, 1.0
    rate = good / of
    centre = rate + z * z / (2 * of)
    half = z * np.sqrt(rate * (1 - rate) / of + z * z / (4 * of * of))
    return (centre - half) / (1 + z * z / of), (centre + half) / (1 + z * z / of)


def _lag(lags: Array) -> str:
    known = lags[np.isfinite(lags)]
    return f"{np.median(known):.3f}, {np.percentile(known, 99):.2f}" if len(known) else "-"


def rms(values: Array) -> float:
    """Root of the mean square of those that are finite; NaN without any."""
    values = values[np.isfinite(values)]
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")


def percent(rate: float | np.floating) -> str:
    """A rate from 0 to 1 in words."""
    return f"{100 * rate:.2f} %"


def millimetres(length: float | np.floating) -> str:
    """A length [m] in words."""
    return f"{1e3 * length:.2f}" if np.isfinite(length) else "-"
