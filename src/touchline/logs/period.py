# SPDX-License-Identifier: Apache-2.0
"""The time between the samples of a recording, and what one that was made live tells of it."""

from typing import Any

import numpy as np

# In the metadata of a recording that was made live: its period [s], and what has made it.
PERIOD_KEY, RECORDER_KEY, RECORDER = "period", "recorder", "touchline live"


def typical_period(time: np.ndarray) -> float:
    """Median step of time stamps [s] that go forward, to six digits; 1 ms where there is none."""
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0]
    return float(f"{np.median(steps):.6g}") if len(steps) else 1e-3


def sample_period(log: Any, time: np.ndarray) -> float:
    """The period with which a log was seen live, or that of its first stamps [s].

    Args:
        log: an opened `touchline.logs.Log`.
        time: (N,) its first stamps [s].
    """
    told = log.metadata.get(PERIOD_KEY)
    return float(told) if isinstance(told, float) and told > 0.0 else typical_period(time)
