# SPDX-License-Identifier: Apache-2.0
"""Which instants of a recording are left out because something seems to touch the robot."""

import numpy as np

from touchline.arrays import Array, Mask
from touchline.identify.evidence import Evidence

QUIET = 0.4  # of the instants at least are untouched, and tell the usual scatter
FAR = 8.0  # usual sigmas; what a good fit leaves seldom lies so far out
SHORTEST = 0.1  # s; shorter excursions are reversals, not touches
STICTION = 2.5  # times Coulomb friction, that a slow joint may hold without anybody's help
SLOW = 0.2  # rad/s; up to here, less and less of it
WITHIN = 0.2  # s; a touch begins or ends faster, and the filter follows within that
ENOUGH = 50  # changes before deciles of them mean something
BESIDE = 2.0  # time constants of the filter on either side belong to a touch
_QUANTILE = 0.524  # 40 % of normal values lie within so many sigmas of the middle


def usual_scatter(left: Array, used: Mask) -> Array:
    """1 sigma (R,) of most of the residuals (N, R), whatever the others do."""
    return np.where(used, np.maximum(_shortest(left)[1], 1e-9), 1.0)


def usual_middle(left: Array) -> Array:
    """Where most of the residuals (N, R) lie, whatever the others do."""
    return _shortest(left)[0]


def _shortest(left: Array) -> tuple[Array, Array]:
    """Middle and scatter (R,) by the shortest interval that holds `QUIET` of the values."""
    ordered = np.sort(left, axis=0)
    inside = max(1, int(np.ceil(QUIET * len(ordered))))
    widths = ordered[inside - 1 :] - ordered[: len(ordered) - inside + 1]
    at = np.argmin(widths, axis=0)
    columns = np.arange(left.shape[1])
    low, high = ordered[at, columns], ordered[at + inside - 1, columns]
    return 0.5 * (low + high), 0.5 * (high - low) / _QUANTILE


def find_touches(evidence: Evidence, left: Array, held: Array) -> Mask:
    """Which instants (N,) are touched.

    Args:
        evidence: the instants.
        left: (N, R) residuals after a fit.
        held: (n,) what a joint that hardly moves may hold by its friction, of either sign [Nm].
    """
    centred = left.copy()
    for number in np.unique(evidence.recording):  # each may rest in a pose of its own
        own = evidence.recording == number
        centred[own] -= usual_middle(left[own])
    scatter = usual_scatter(centred, evidence.used)
    slow = np.maximum(0.0, 1.0 - np.abs(evidence.qd) / SLOW)
    excess = np.abs(centred)
    excess[:, : evidence.joints] -= held * slow
    out = np.any((excess / scatter > FAR)[:, evidence.used], axis=1)
    touched = np.zeros(len(evidence), dtype=bool)
    beside = BESIDE / evidence.bandwidth
    for start, stop in _runs(out, evidence):
        begin, end = evidence.time[start], evidence.time[stop]
        if end - begin < SHORTEST:
            continue
        own = evidence.recording == evidence.recording[start]
        near = (evidence.time >= begin - beside) & (evidence.time <= end + beside)
        touched |= own & near
    return touched


def jumps(evidence: Evidence, left: Array, use: Mask) -> tuple[int, float]:
    """The row whose residual jumps most, and how: changes within `WITHIN`, large ones over usual.

    Touches begin and end; errors of a model come and go with the motion.

    Args:
        evidence: the instants.
        left: (N, R) residuals after a fit.
        use: (N,) the instants; changes across others do not count.

    Returns:
        A row, and the ninth decile of its changes in units of their median: 2.4 for normal noise.
    """
    steps = np.diff(evidence.time)[np.diff(evidence.recording) == 0]
    apart = max(1, round(WITHIN / float(np.median(steps)))) if len(steps) else 1
    if len(left) <= apart:
        return 0, 0.0
    skipped = np.concatenate([[0], np.cumsum(~use)])
    whole = skipped[apart + 1 :] == skipped[: -apart - 1]
    whole &= evidence.recording[apart:] == evidence.recording[:-apart]
    if whole.sum() < ENOUGH:
        return 0, 0.0
    change = np.abs(left[apart:] - left[:-apart])[whole]
    usual, large = np.quantile(change, (0.5, 0.9), axis=0)
    size = np.where(evidence.used, large / np.maximum(usual, 1e-12), 0.0)
    return int(np.argmax(size)), float(size.max(initial=0.0))


def stretches(evidence: Evidence, touched: Mask) -> list[tuple[int, float, float]]:
    """Recording, begin and end [s] of the touched stretches."""
    return [
        (int(evidence.recording[a]), float(evidence.time[a]), float(evidence.time[b]))
        for a, b in _runs(touched, evidence)
    ]


def _runs(flags: Mask, evidence: Evidence) -> list[tuple[int, int]]:
    """First and last index of each run; a recording's end ends a run."""
    runs: list[tuple[int, int]] = []
    for i in np.flatnonzero(flags).tolist():
        same = runs and runs[-1][1] == i - 1 and evidence.recording[i] == evidence.recording[i - 1]
        if same:
            runs[-1] = runs[-1][0], i
        else:
            runs.append((i, i))
    return runs
