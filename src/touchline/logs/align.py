# SPDX-License-Identifier: Apache-2.0
"""Interpolates a signal at the instants of another, on time stamps as they come.

Stamps may jitter, repeat, go back or be plainly wrong for a moment. Each row looks for its
neighbours only near the place where it was logged. So one bad stamp harms only the rows beside
it, and a long log can be read in pieces without a trace in the numbers.
"""

from dataclasses import dataclass

import numpy as np

# Between samples no farther than this many periods a value is known.
REACH_PERIODS = 3.0


@dataclass(frozen=True)
class Bracket:
    """The two samples around each of N instants.

    Attributes:
        before: (N,) index of the sample at or before the instant.
        after: (N,) index of the sample after it.
        weight: (N,) of the sample after; NaN where the instant has no neighbours in reach.
    """

    before: np.ndarray
    after: np.ndarray
    weight: np.ndarray

    def interpolate(self, values: np.ndarray) -> np.ndarray:
        """Linear interpolation of (M, ...) values; a NaN reaches only the rows it neighbours."""
        weight = self.weight.reshape((-1,) + (1,) * (values.ndim - 1))
        early, late = values[self.before], values[self.after]
        with np.errstate(invalid="ignore"):
            between = early + weight * (late - early)
        # A row that falls on a sample takes nothing from the other one.
        return np.where(weight == 0.0, early, between)


def find_bracket(
    stamps: np.ndarray,
    instants: np.ndarray,
    start: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    reach: float,
) -> Bracket:
    """Find each instant's neighbours among the samples low..high-1, beginning at `start`.

    Args:
        stamps: (M,) of the samples [s].
        instants: (N,) at which values are wanted [s].
        start: (N,) sample at which the search begins.
        low: (N,) first sample that may be used.
        high: (N,) one after the last sample that may be used.
        reach: largest distance to the nearer neighbour [s].
    """
    if len(stamps) == 0:
        nowhere = np.zeros(len(instants), dtype=np.intp)
        # There is nothing to index either; the caller's values are empty too.
        return Bracket(nowhere, nowhere, np.full(len(instants), np.nan))
    with np.errstate(invalid="ignore"):
        if np.all(stamps[1:] >= stamps[:-1]) and np.isfinite(stamps[-1]):
            at = np.searchsorted(stamps, instants, side="right") - 1
            at = np.minimum(at, high - 1)
        else:
            at = _walk(stamps, instants, np.clip(start, low, high - 1), low, high)
        return _weigh(stamps, instants, at, low, high, reach)


def _weigh(
    stamps: np.ndarray,
    instants: np.ndarray,
    at: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    reach: float,
) -> Bracket:
    inside = (at >= low) & (high > low)
    before = np.where(inside, at, 0)
    paired = inside & (before + 1 < high)
    after = np.where(paired, before + 1, before)
    past, ahead = instants - stamps[before], stamps[after] - instants
    with np.errstate(divide="ignore"):
        weight = np.where(paired, past / (past + ahead), np.nan)
    weight[~(np.minimum(past, ahead) <= reach)] = np.nan
    weight[inside & (past == 0.0)] = 0.0
    return Bracket(before, after, weight)


def _walk(
    stamps: np.ndarray, instants: np.ndarray, start: np.ndarray, low: np.ndarray, high: np.ndarray
) -> np.ndarray:
    """Step from `start` forward past every sample at or before the instant, else back.

    Where the stamps near `start` do not go back this finds what a sorted search would.
    """
    at = start.copy()
    active = np.arange(len(at))
    while len(active := active[_may_step(stamps, instants, at, high, active)]):
        at[active] += 1
    active = np.flatnonzero(high > low)
    while len(active := active[at[active] >= low[active]]):
        active = active[stamps[at[active]] > instants[active]]
        at[active] -= 1
    return at


def _may_step(
    stamps: np.ndarray, instants: np.ndarray, at: np.ndarray, high: np.ndarray, active: np.ndarray
) -> np.ndarray:
    following = at[active] + 1
    possible = following < high[active]
    following = np.minimum(following, len(stamps) - 1)
    return possible & (stamps[following] <= instants[active])


def typical_period(stamps: np.ndarray) -> float:
    """Median of the positive steps between stamps [s]; NaN where there is none."""
    steps = np.diff(stamps)
    steps = steps[np.isfinite(steps) & (steps > 0.0)]
    return float(np.median(steps)) if len(steps) else float("nan")


def delay_halo(delay: float, period: float) -> int:
    """Rows on either side in which a signal shifted by `delay` [s] is looked for."""
    if delay == 0.0 or not np.isfinite(period):
        return 0
    return int(min(np.ceil(2.0 * abs(delay) / period) + 8, 200_000))


def shift(
    stamps: np.ndarray,
    values: np.ndarray,
    delay: float,
    rows: slice,
    halo: int,
    period: float,
) -> np.ndarray:
    """Undo a delay: what was logged at t belongs to t - delay, so read it at t + delay.

    Args:
        stamps: (M,) of the rows and their neighbours [s].
        values: (M, ...) logged beside them.
        delay: [s], of either sign.
        rows: the rows wanted.
        halo: rows on either side that may be used.
        period: of the log [s].

    Returns:
        (rows, ...); NaN where the log does not reach.
    """
    own = np.arange(rows.start, rows.stop)
    low = np.maximum(own - halo, 0)
    high = np.minimum(own + halo + 1, len(stamps))
    bracket = find_bracket(stamps, stamps[rows] + delay, own, low, high, REACH_PERIODS * period)
    return bracket.interpolate(values)
