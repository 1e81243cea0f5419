# SPDX-License-Identifier: Apache-2.0
"""The observer's filter on any signals of a recording: first order, over intervals that vary.

    r+ = a r + (1 - a) e,   e = (p_k+1 - p_k) / dt - (u_k + u_k+1) / 2

The poles are those of the native core with `automatic`: Tustin's up to K dt = 0.5. Gaps of up to
two lost samples are bridged. The core bridges longer ones as well, with a doubt of its own; here
the filter begins anew, since nothing shall be learnt from doubtful values.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Mask
from touchline.tuning import DEFAULTS

LONGEST = DEFAULTS["observer.gap_periods"]  # longer intervals are not integrated over
SETTLING = DEFAULTS["observer.settled_steps"]  # time constants after a start


@dataclass(frozen=True)
class Steps:
    """The intervals of a recording.

    Attributes:
        dt: (N - 1,) [s].
        usable: (N - 1,) is the interval one to integrate over?
        keep: (N - 1,) the filter's pole over it.
    """

    dt: Array
    usable: Mask
    keep: Array

    def part(self, start: int, stop: int) -> "Steps":
        """Some of the intervals."""
        return Steps(self.dt[start:stop], self.usable[start:stop], self.keep[start:stop])


def make_steps(time: Array, bandwidth: float, present: Mask) -> Steps:
    """Intervals between samples that go forward in time.

    Args:
        time: (N,) stamps [s] in rising order.
        bandwidth: K [rad/s].
        present: (N,) are all signals there?
    """
    dt = np.diff(time)
    period = float(np.median(dt)) if len(dt) else 1.0
    usable = (dt > 0) & (dt <= LONGEST * period) & present[1:] & present[:-1]
    x = bandwidth * np.maximum(dt, 1e-9)
    keep = np.where(x <= 0.5, (1.0 - 0.5 * x) / (1.0 + 0.5 * x), np.exp(-x))
    return Steps(dt, usable, keep)


def derivative(values: Array, steps: Steps) -> Array:
    """Mean rates (N - 1, ...) over the intervals."""
    return np.diff(values, axis=0) / _beside(steps.dt, values)


def mean(values: Array) -> Array:
    """Means (N - 1, ...) over the intervals, by the trapezoid."""
    return 0.5 * (values[1:] + values[:-1])


def smooth(inputs: Array, steps: Steps, start: Array | None = None) -> Array:
    """Filters inputs (N - 1, ...) from `start`; where an interval is not usable, anew from zero."""
    flat = inputs.reshape(len(inputs), -1)
    out, added = np.empty_like(flat), np.empty(flat.shape[1])
    fresh = 1.0 - steps.keep
    value = np.zeros(flat.shape[1]) if start is None else start
    for i, row in enumerate(out):
        if steps.usable[i]:
            np.multiply(value, steps.keep[i], row)
            np.multiply(flat[i], fresh[i], added)
            row += added
        else:
            row[:] = 0.0
        value = row
    return out.reshape(inputs.shape)


def settled(steps: Steps, bandwidth: float) -> Mask:
    """Per interval, has the filter run for long enough since its last start?"""
    since, told = 0.0, np.zeros(len(steps.dt), dtype=bool)
    for i, dt in enumerate(steps.dt):
        since = since + dt if steps.usable[i] else 0.0
        told[i] = since >= SETTLING / bandwidth
    return told


def _beside(dt: Array, values: Array) -> Array:
    return np.maximum(dt, 1e-9).reshape(-1, *(1 for _ in values.shape[1:]))
