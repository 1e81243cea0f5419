# SPDX-License-Identifier: Apache-2.0
"""Every signal of a recording by itself: is it there, alive, in range; and the time stamps."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array, Mask
from touchline.check.findings import Findings, Kind
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

ENOUGH = 50  # samples before a constant signal is called dead
MOST = 40.0  # %; a signal at half the rate of the rows misses half, drop-outs hardly so much
FEW = 0.005  # of the samples may be missing, late or at the end of the range
RUN = 5  # samples in a row with exactly one value: held, where noise would change them
STUCK = 100  # samples in a row, and none so long elsewhere, before a live signal is called stuck
CLIPPED = 0.01  # of the samples held at the largest or the least value
ALIVE = 0.01  # of the other samples may be held; more is a coarse or a resampled signal
NEAR_ZERO = 0.1  # rad or degrees; a joint that stays so near zero says nothing of its unit
OUTSIDE = 0.01  # rad or m beyond the limits before it is said


@dataclass(frozen=True)
class Signal:
    """Where a column of the signal table comes from; `motor`: a torque from a motor's current."""

    kind: str
    name: str
    index: tuple[int, ...]
    range: float
    motor: bool = False


def signals_of(robot: Robot) -> list[Signal]:
    """All measured signals, in the order of `SignalTable`."""
    description = robot.description
    signals = []
    for kind in ("q", "qd", "tau"):
        for j, joint in enumerate(description.joints):
            if kind != "tau" or joint.measured:
                reach = joint.range / joint.gain if kind == "tau" else np.inf
                motor = kind == "tau" and joint.torque == "motor"
                signals.append(Signal(kind, joint.name, (j,), reach, motor))
    for k, sensor in enumerate(description.sensors):
        for axis in sensor.axes:
            i = AXES.index(axis)
            # In other axes than the sensor's the range does not belong to one column.
            reach = sensor.range[i] if sensor.frame == "sensor" else np.inf
            signals.append(Signal("wrench", f"{sensor.name}.{axis}", (k, i), reach))
    return signals


class SignalTable:
    """Least and largest value, samples missing, not finite and at the end of the range."""

    def __init__(self, robot: Robot) -> None:
        self.signals = signals_of(robot)
        count = len(self.signals)
        self.samples = 0
        self.low, self.high = np.full(count, np.inf), np.full(count, -np.inf)
        self.missing, self.infinite = np.zeros(count, int), np.zeros(count, int)
        self.at_range = np.zeros(count, int)
        self.held, self.longest = np.zeros(count, int), np.zeros(count, int)
        self.held_low, self.held_high = np.zeros(count, int), np.zeros(count, int)

    def add(self, part: Samples) -> None:
        """Take N samples."""
        self.samples += len(part)
        for i, values in enumerate(self._columns(part)):
            finite = np.isfinite(values)
            if self.signals[i].kind in ("tau", "wrench"):
                still = self._still(i, part)[finite] if self.signals[i].motor else None
                self._add_runs(i, values[finite], still)
            self.missing[i] += int(np.isnan(values).sum())
            self.infinite[i] += int(np.isinf(values).sum())
            self.low[i] = min(self.low[i], values.min(where=finite, initial=np.inf))
            self.high[i] = max(self.high[i], values.max(where=finite, initial=-np.inf))
            self.at_range[i] += int((np.abs(values) >= self.signals[i].range).sum())

    def _still(self, i: int, part: Samples) -> Mask:
        """Samples to which the joint did not move by a bit: a controller's output may rest too."""
        return np.diff(part.q[:, self.signals[i].index[0]], prepend=np.nan) == 0

    def _add_runs(self, i: int, values: Array, still: Mask | None) -> None:
        """Counts what is held; called before the least and largest value take these samples."""
        if not len(values):
            return
        edges = np.flatnonzero(np.diff(values, prepend=np.nan, append=np.nan) != 0)
        length, value = np.diff(edges), values[edges[:-1]]
        held = length >= RUN
        if still is not None:
            # The step to the first sample of a run is none within it.
            moved = np.concatenate([[0], np.cumsum(~still)])
            held &= moved[edges[1:]] > moved[edges[:-1] + 1]
        run = np.where(held, length, 0)
        self.held[i] += int(run.sum())
        self.longest[i] = max(self.longest[i], int(run.max(initial=0)))
        low, high = float(values.min()), float(values.max())
        if low <= self.low[i]:
            self.held_low[i] = int(run[value == low].sum()) + self.held_low[i] * (
                low == self.low[i]
            )
        if high >= self.high[i]:
            self.held_high[i] = int(run[value == high].sum()) + self.held_high[i] * (
                high == self.high[i]
            )

    def _columns(self, part: Samples) -> Iterator[Array]:
        for signal in self.signals:
            yield getattr(part, signal.kind)[(slice(None), *signal.index)]

    def dead(self) -> set[tuple[str, str]]:
        """(kind, name) of the signals that never change."""
        if self.samples < ENOUGH:
            return set()
        still = self.low == self.high
        return {(s.kind, s.name) for s, d in zip(self.signals, still, strict=True) if d}

    def report(self, robot: Robot, findings: Findings) -> None:
        """Say what is wrong with single signals."""
        moving = {
            s.name
            for i, s in enumerate(self.signals)
            if s.kind == "q" and self.high[i] - self.low[i] > OUTSIDE
        }
        for i, signal in enumerate(self.signals):
            self._report_one(i, signal, findings)
            if self.samples < ENOUGH or self.low[i] != self.high[i]:
                continue
            if signal.kind in ("tau", "wrench") or signal.name in moving:
                findings.find(self._dead_words(i), Kind.SIGNAL)
        self.report_limits(robot, findings)

    def _dead_words(self, i: int) -> str:
        what = f"is always {self.low[i]:g}: dead, or not what the column should hold"
        return f"{_column(self.signals[i])} {what}"

    def dead_lines(self) -> list[str]:
        """Torques and wrenches that never change while a joint moves; alike ones in one line."""
        moved = any(
            s.kind == "q" and self.high[i] - self.low[i] > OUTSIDE
            for i, s in enumerate(self.signals)
        )
        dead = self.dead() if moved else set()
        columns: dict[tuple[str, float], list[str]] = {}
        for i, s in enumerate(self.signals):
            if s.kind in ("tau", "wrench") and (s.kind, s.name) in dead:
                columns.setdefault((s.kind, float(self.low[i])), []).append(s.name)
        return [
            f"{'torque of ' if kind == 'tau' else ''}{', '.join(names)} "
            f"{'is' if len(names) == 1 else 'are'} always {value:g}: dead, or not what the "
            f"column{'s' * (len(names) > 1)} should hold"
            for (kind, value), names in columns.items()
        ]

    def dead_words(self, kind: str, name: str) -> str | None:
        """What is said of a signal that never changes; None of one that does."""
        if (kind, name) not in self.dead():
            return None
        return next(
            self._dead_words(i)
            for i, s in enumerate(self.signals)
            if (s.kind, s.name) == (kind, name)
        )

    def _report_one(self, i: int, signal: Signal, findings: Findings) -> None:
        column, few = _column(signal), FEW * self.samples
        if self.missing[i] == self.samples:
            findings.find(f"{column}: no value in the whole recording", Kind.SIGNAL)
        elif self.missing[i] > few:
            share = 100 * self.missing[i] / self.samples
            slow = "; interpolate what is sampled more slowly than the rows" if share > MOST else ""
            findings.find(f"{column}: missing in {share:.1f} % of the samples{slow}")
        if self.infinite[i]:
            findings.find(f"{column}: infinite in {self.infinite[i]} samples", Kind.SIGNAL)
        if self.at_range[i] <= few:
            self._report_held(i, column, findings)
        else:
            share = 100 * self.at_range[i] / self.samples
            findings.find(
                f"{column}: at or beyond its range {signal.range:g} in {share:.1f} % of the "
                f"samples (it reaches {max(abs(self.low[i]), abs(self.high[i])):.4g}): saturated, "
                "or in other units",
                Kind.SIGNAL,
            )

    def _report_held(self, i: int, column: str, findings: Findings) -> None:
        what = self._held(i)
        if what == "stuck":
            findings.find(
                f"{column}: {self.longest[i]} samples in a row have one value, which else changes "
                "with every sample: stuck"
            )
        elif what:
            low = what == "least"
            count, value = (
                (self.held_low[i], self.low[i]) if low else (self.held_high[i], self.high[i])
            )
            findings.find(
                f"{column}: {100 * count / self.samples:.1f} % of the samples stand at its "
                f"{what} value {value:.4g}: clipped; set range"
            )

    def _held(self, i: int) -> str:
        """How a signal that else never rests has exactly one value for long.

        "stuck", or clipped at its "largest" or "least" value; "" of others.
        """
        if self.samples < ENOUGH or self.low[i] == self.high[i]:
            return ""
        ends = ("largest", self.held_high[i]), ("least", self.held_low[i])
        for what, count in ends:
            others = self.held[i] - self.held_low[i] - self.held_high[i]
            if count > max(CLIPPED * self.samples, 2 * RUN) and others < ALIVE * self.samples:
                return what
        others = self.held[i] - self.longest[i]
        return "stuck" if self.longest[i] >= STUCK and others < ALIVE * self.samples else ""

    def held_names(self, kind: str, stuck: bool) -> set[str]:
        """Names of a kind's signals that are stuck for a part of the recording, or else clipped."""
        held = ((s, self._held(i)) for i, s in enumerate(self.signals) if s.kind == kind)
        return {s.name for s, what in held if what and (what == "stuck") == stuck}

    def report_limits(self, robot: Robot, findings: Findings) -> None:
        """Say which positions leave the model's limits, or are no angles in rad."""
        outside = self.outside_limits(robot)
        degrees = self.looks_like_degrees(robot)
        for name, low, high, lower, upper in outside[: 1 if degrees else None]:
            line = (
                f"position of {name} goes from {low:.4g} to {high:.4g}, outside the model's limits "
                f"{lower:.4g} to {upper:.4g}"
            )
            if degrees:
                line += ": the positions look like degrees; use factor 0.01745329 in log"
            findings.find(line, Kind.SIGNAL if degrees else Kind.FINE)

    def _positions(self, robot: Robot) -> Iterator[tuple[str, float, float, float, float]]:
        for i, signal in enumerate(self.signals):
            if signal.kind == "q" and self.low[i] <= self.high[i]:
                model = robot.mechanism.joints[signal.name]
                yield signal.name, self.low[i], self.high[i], model.lower, model.upper

    def outside_limits(self, robot: Robot) -> list[tuple[str, float, float, float, float]]:
        """Name, range of positions and limits of the joints that leave their limits."""
        return [p for p in self._positions(robot) if p[1] < p[3] - OUTSIDE or p[2] > p[4] + OUTSIDE]

    def looks_like_degrees(self, robot: Robot) -> bool:
        """Are positions far outside, and all inside when taken for degrees?

        A joint that may turn on and on leaves its limits alone: of degrees most joints would.
        """
        joints = robot.mechanism.joints
        found = [p for p in self._positions(robot) if joints[p[0]].kind == "revolute"]
        outside = {p[0] for p in self.outside_limits(robot)}
        limited = [p for p in found if np.isfinite(p[3]) or np.isfinite(p[4])]
        stand = [p for p in limited if max(abs(p[1]), abs(p[2])) > NEAR_ZERO]
        if 2 * sum(p[0] in outside for p in stand) < len(stand):
            return False
        far = any(max(-low, high) > 4 * np.pi for _, low, high, _, _ in found)
        inside = all(
            np.deg2rad(low) >= lower - 0.1 and np.deg2rad(high) <= upper + 0.1
            for _, low, high, lower, upper in found
        )
        return far and inside


def _column(signal: Signal) -> str:
    what = {"q": "position of ", "qd": "velocity of ", "tau": "torque of ", "wrench": ""}
    return f"{what[signal.kind]}{signal.name}"
