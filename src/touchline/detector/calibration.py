# SPDX-License-Identifier: Apache-2.0
"""Thresholds of every method from contact-free motion, at any false-alarm rate.

Two passes over the same motion. The first finds what the model's errors leave in each row and how
that grows with speed and acceleration; the second how often each method's statistic exceeds what.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array, Index, Mask
from touchline.detector.detector import Detector
from touchline.detector.tail import LEAST_PEAKS, Tail, count_clusters, fit_tail
from touchline.detector.thresholds import (
    COLLISION_RATIO,
    Thresholds,
    make_thresholds,
    row_name,
    without_limits,
)
from touchline.model.description import CalibrationDescription, RowCalibration
from touchline.model.robot import Robot
from touchline.model.values import METHODS
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples

BLOCK = 0.02  # s, over which the largest value of a statistic is kept
GAP = 0.2  # s; alarms closer than this are one
EVERY = 0.01  # s, between the residuals that model errors are fitted to
# s; after a longer gap what stands there is an offset, as where a recording begins. So it is where
# a touch was left out, since dry friction leaves another offset after each.
BROKEN = 0.2
FAR = 6.0  # robust standard deviations; residuals beyond it count as if they were there
ROUNDS = 4
LEAST_ERROR = 0.05  # of the typical residual: no model is better


@dataclass(frozen=True)
class Residuals:
    """What contact-free motion left in the rows, thinned out.

    Attributes:
        residual: (N, r) residuals less baseline [N or Nm].
        slow, quick: (N, r) residuals less baseline, less reference, low-passed once more.
        noise: (N, r) the variance of these two by the noise of the signals.
        activity: (N, 2) squared speed, acceleration.
    """

    residual: Array
    slow: Array
    quick: Array
    noise: Array
    activity: Array


@dataclass(frozen=True)
class Statistics:
    """The largest values of all statistics over short blocks of time.

    Attributes:
        blocks: (N, m, t); NaN between recordings.
        time: (N,) [s] within its recording.
        recording: (N,) its number.
        hours: of motion that was watched.
        length: of a block [s].
    """

    blocks: Array
    time: Array
    recording: Index
    hours: float
    length: float = BLOCK

    @property
    def gap(self) -> int:
        """Alarms at most so many blocks apart are one."""
        return max(1, round(GAP / self.length))

    def part(self, use: Mask) -> "Statistics":
        """Some of the blocks."""
        hours = self.hours * float(use.mean())
        return Statistics(self.blocks[use], self.time[use], self.recording[use], hours, self.length)


def with_methods(robot: Robot, *methods: str, **settings) -> Robot:
    """The robot, tested by these methods; `settings` of its `detection`."""
    detection = replace(robot.description.detection, method=methods, **settings)
    return Robot(replace(robot.description, detection=detection), robot.mechanism)


def with_calibration(robot: Robot, calibration: CalibrationDescription) -> Robot:
    """The robot, calibrated."""
    return with_methods(robot, *robot.description.detection.method, calibration=calibration)


def collect_residuals(
    robot: Robot, period: float, recordings: Iterable[Iterable[Samples]]
) -> Residuals:
    """First pass: each recording comes in parts."""
    robot = with_methods(robot, "scaled")
    thresholds = without_limits(make_thresholds(robot, period))
    rows = tuple(replace(r, baseline_limit=1e9, collision=1e9) for r in thresholds.rows)
    thresholds = replace(thresholds, rows=rows)
    every = max(1, round(EVERY / period))
    parts: list[tuple[Array, ...]] = []
    for recording in recordings:
        detector = Detector(Observer(robot), thresholds, period)
        for begins, s in _unbroken(recording):
            if begins:
                detector = Detector(Observer(robot), thresholds, period)
            d = detector.details(s.time, s.q, s.qd, s.tau, s.wrench, every)
            parts.append((d.residual, d.slow, d.quick, d.noise, d.activity))
    return Residuals(*(np.concatenate(x) for x in zip(*parts, strict=True)))


def _unbroken(recording: Iterable[Samples]) -> Iterator[tuple[bool, Samples]]:
    """Parts of a recording without long gaps; does one begin after such a gap?"""
    last = np.inf
    for s in recording:
        after = np.flatnonzero(np.diff(s.time, prepend=last) > BROKEN)
        edges = [0, *after[after > 0].tolist(), len(s)]
        for start, end in zip(edges[:-1], edges[1:], strict=True):
            if end > start:
                yield start in after, s.where(slice(start, end))
        last = s.time[-1] if len(s) else last


def fit_rows(robot: Robot, period: float, found: Residuals) -> dict[str, RowCalibration]:
    """What the model's errors leave in each row."""
    rows = {}
    for i, row in enumerate(make_thresholds(with_methods(robot, "rows"), period).rows):
        known = np.isfinite(found.slow[:, i])
        if known.sum() < 100:
            continue
        activity, noise = found.activity[known], found.noise[known, i]
        slow, quick = found.slow[known, i], found.quick[known, i]
        typical = float(np.sqrt(np.mean(_tamed(found.residual[known, i]) ** 2)))
        rows[row_name(robot, row)] = RowCalibration(
            _digits(max(typical, 1e-6)),
            fit_growth(_tamed(slow), noise, activity),
            fit_growth(_tamed(quick), noise, activity),
        )
    return rows


def grown(rows: dict[str, RowCalibration], growth: dict[str, float]) -> dict[str, RowCalibration]:
    """What the errors leave on motion that played no part in the identification of the model.

    Args:
        rows: as fitted to the motion that the model was fitted to.
        growth: by row, how much larger residuals are elsewhere, at least 1.
    """
    return {name: _times(row, growth.get(name, 1.0)) for name, row in rows.items()}


def _times(row: RowCalibration, factor: float) -> RowCalibration:
    slow, quick = ((c * factor, v * factor, a * factor) for c, v, a in (row.slow, row.quick))
    return RowCalibration(_digits(row.typical * factor), _rounded(slow), _rounded(quick))


def _rounded(values: Iterable[float]) -> tuple[float, float, float]:
    constant, speed, acceleration = (_digits(value) for value in values)
    return constant, speed, acceleration


def fit_growth(residual: Array, noise: Array, activity: Array) -> tuple[float, float, float]:
    """Sigmas of a model error: constant, per squared speed, per acceleration.

    Least squares of the squared residual, less what noise explains, on non-negative terms, weighed
    by the variance that the fit itself predicts.
    """
    from scipy.optimize import nnls

    terms = np.column_stack([np.ones(len(residual)), activity**2 * np.array([1.0, 1.0])])
    squared = residual**2
    weight = np.full(len(residual), 1.0 / max(float(squared.mean()), 1e-30))
    least = (LEAST_ERROR**2) * float(squared.mean())
    found = np.zeros(3)
    for _ in range(ROUNDS):
        A = terms * weight[:, None]
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-30)
        # The normal equations: three unknowns, and non-negative least squares is slow on many rows.
        G, b = (A / scale).T @ (A / scale), (A / scale).T @ ((squared - noise) * weight)
        L = np.linalg.cholesky(G + 1e-12 * np.eye(3))
        found = nnls(L.T, np.linalg.solve(L, b))[0] / scale
        weight = 1.0 / np.maximum(terms @ found + noise, least)
    found[0] = max(found[0], least)
    return _rounded(float(x) for x in np.sqrt(found))


def collect_statistics(
    robot: Robot,
    period: float,
    rows: dict[str, RowCalibration],
    recordings: Iterable[Iterable[Samples]],
    methods: tuple[str, ...] = METHODS,
) -> Statistics:
    """Second pass: the statistics of all methods, which never fire here."""
    robot = with_methods(robot, *methods)
    calibration = CalibrationDescription(1.0, period, rows, {})
    robot = with_calibration(robot, calibration)
    thresholds = watching(robot, period, rows)
    per_block = max(1, round(BLOCK / period))
    hold = round(robot.description.detection.min_duration / period)
    shape = _shape(thresholds)
    blocks, times, numbers, count = [], [], [], 0
    for number, recording in enumerate(recordings):
        detector = Detector(Observer(robot), thresholds, period)
        rest, rest_time = np.empty((0, *shape)), np.empty(0)
        for begins, s in _unbroken(recording):
            if begins:
                detector = Detector(Observer(robot), thresholds, period)
                rest, rest_time = np.full((1, *shape), np.nan), s.time[:1]
            found = detector.details(s.time, s.q, s.qd, s.tau, s.wrench, max(1, len(s.time)))
            count += len(s.time)
            values = np.concatenate([rest, found.statistics])
            time = np.concatenate([rest_time, s.time])
            held = _held(values, hold)
            whole = max(len(held) // per_block, 0) * per_block
            blocks.append(_maxima(held[:whole], per_block))
            times.append(time[:whole:per_block])
            numbers.append(np.full(len(times[-1]), number))
            rest, rest_time = values[whole:], time[whole:]
        blocks.append(np.full((1, *shape), np.nan))
        times.append(np.full(1, np.nan))
        numbers.append(np.full(1, number))
    hours = count * period / 3600
    return Statistics(
        np.concatenate(blocks),
        np.concatenate(times),
        np.concatenate(numbers),
        hours,
        per_block * period,
    )


def fit_tails(
    robot: Robot,
    found: Statistics,
    methods: tuple[str, ...] = METHODS,
    least: int = LEAST_PEAKS,
) -> dict[str, dict[str, Tail]]:
    """Tails by segment and method, as far as there are `least` alarms to fit them to."""
    tails: dict[str, dict[str, Tail]] = {}
    for g, segment in enumerate(robot.segment_names):
        for t, method in enumerate(methods):
            series = found.blocks[:, g, t]
            tail = (
                fit_tail(series, found.hours, found.gap, least) if np.nanmax(series) > 0 else None
            )
            if tail is not None:
                tails.setdefault(segment, {})[method] = tail
    return tails


def describe(
    hours: float, period: float, rows: dict[str, RowCalibration], tails: dict[str, dict[str, Tail]]
) -> CalibrationDescription:
    """All of it as it stands in `robot.yaml`."""
    return CalibrationDescription(
        float(f"{hours:.4g}"),
        period,
        rows,
        {s: {m: tail.description() for m, tail in of.items()} for s, of in tails.items()},
    )


def count_alarms(found: Statistics, limits: Array, t: int) -> int:
    """How many alarms a method would have given, with its limits (m,) of the segments."""
    return sum(
        count_clusters(found.blocks[:, g, t], limit, found.gap)
        for g, limit in enumerate(limits)
        if np.isfinite(limit)
    )


def watching(robot: Robot, period: float, rows: dict[str, RowCalibration]) -> Thresholds:
    """Tests that never fire, with rows in units of what is typical of them."""
    thresholds = without_limits(make_thresholds(robot, period))
    limit = robot.description.detection.baseline.limit * COLLISION_RATIO
    watched = []
    for row in thresholds.rows:
        known = rows.get(row_name(robot, row))
        typical = known.typical if known else row.contact
        watched.append(
            replace(row, contact=typical, collision=1e9, baseline_limit=limit * typical, seen=1.0)
        )
    return replace(thresholds, rows=tuple(watched))


def _shape(thresholds: Thresholds) -> tuple[int, int]:
    return len(thresholds.sum_limit), len(thresholds.limits)


def _held(values: Array, hold: int) -> Array:
    """What the statistics (N, ...) have exceeded for `hold` intervals; the last ones are dropped.

    A value is that of the interval that begins with it.
    """
    if hold == 0:
        return values
    if len(values) <= hold:
        return values[:0]
    windows = np.lib.stride_tricks.sliding_window_view(values, hold + 1, axis=0)
    return windows.min(axis=-1)


def _maxima(values: Array, per_block: int) -> Array:
    if not len(values):
        return values
    return values.reshape(-1, per_block, *values.shape[1:]).max(axis=1)


def _tamed(residual: Array) -> Array:
    """Residuals, those far out drawn in: a contact shall not pass for a model error."""
    spread = 1.4826 * float(np.median(np.abs(residual)))
    return np.clip(residual, -FAR * spread, FAR * spread) if spread > 0 else residual


def _digits(x: float) -> float:
    return float(f"{x:.4g}")
