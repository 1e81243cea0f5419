# SPDX-License-Identifier: Apache-2.0
"""The time stamps of a recording: rate, jitter, gaps, and stamps that repeat or go back."""

import numpy as np

from touchline.arrays import Array
from touchline.check.findings import Findings, Kind
from touchline.tuning import DEFAULTS

GAP = DEFAULTS["observer.gap_periods"]  # periods; the observer starts anew after a longer step
FEW = 0.005
JITTER = 0.3  # of the period, standard deviation
SLOW, FAST = 0.5, 2e-5  # s; a robot is not sampled slower or faster
UNITS = ((1e-3, "milliseconds"), (1e-6, "microseconds"), (1e-9, "nanoseconds"))


class Stamps:
    """Gathers the steps between time stamps."""

    def __init__(self, period: float) -> None:
        self.period = period
        self.samples = self.repeated = self.backward = self.gaps = self.invalid = 0
        self.longest = 0.0
        self._last = np.nan
        self._count, self._sum, self._squares = 0, 0.0, 0.0

    def add(self, time: Array) -> None:
        """Take N stamps [s]."""
        self.samples += len(time)
        finite = time[np.isfinite(time)]
        self.invalid += len(time) - len(finite)
        steps = np.diff(finite, prepend=self._last) if len(finite) else finite
        steps = steps[np.isfinite(steps)]
        if len(finite):
            self._last = float(finite[-1])
        self.repeated += int((steps == 0).sum())
        self.backward += int((steps < 0).sum())
        self.gaps += int((steps > GAP * self.period).sum())
        self.longest = max(self.longest, float(steps.max(initial=0.0)))
        usual = steps[(steps > 0) & (steps <= GAP * self.period)]
        self._count += len(usual)
        self._sum += float(usual.sum())
        self._squares += float((usual**2).sum())

    @property
    def jitter(self) -> float:
        """Standard deviation of the steps [s], gaps left out."""
        if not self._count:
            return 0.0
        mean = self._sum / self._count
        return float(np.sqrt(max(self._squares / self._count - mean**2, 0.0)))

    @property
    def credible(self) -> bool:
        """Can these stamps be seconds?"""
        return FAST < self.period < SLOW

    def report(self, findings: Findings) -> None:
        """Facts and findings."""
        findings.note(
            "time stamps",
            f"  {self.samples} samples, median step {1e3 * self.period:.4g} ms "
            f"({1 / self.period:.4g} Hz), jitter {1e3 * self.jitter:.3g} ms, longest step "
            f"{1e3 * self.longest:.4g} ms",
            f"  {self.repeated} repeated, {self.backward} going back, {self.gaps} gaps of more "
            f"than {GAP:g} steps, {self.invalid} not a number",
        )
        if not self.credible:
            findings.find(self.incredible, Kind.SIGNAL)
            return
        few = FEW * self.samples
        for count, what in (
            (self.repeated, "repeat the one before: those samples are ignored"),
            (self.backward, "go back"),
            (self.invalid, "are no numbers"),
        ):
            if count > few:
                share = 100 * count / self.samples
                findings.find(f"time: {share:.1f} % of the stamps {what}")
        if self.gaps > few or self.longest > 1.0:
            findings.find(
                f"time: {self.gaps} gaps, the longest {self.longest:.3g} s: the observer starts "
                "anew after each"
            )
        if self.jitter > JITTER * self.period:
            share = 100 * self.jitter / self.period
            findings.find(f"time: the steps vary by {share:.0f} % of the period (1 sigma)")

    @property
    def incredible(self) -> str:
        """What is said of a period that no robot has."""
        start = f"time: the median step is {self.period:.4g} s"
        for factor, name in UNITS:
            if factor == self.unit_factor:
                return f"{start}; in {name}? then log: time: {{column: NAME, factor: {factor:g}}}"
        fast = self.period < FAST
        return start + (": too fast for a robot's log; check the unit" if fast else "")

    @property
    def unit_factor(self) -> float | None:
        """What would make seconds of the stamps; None where no unit does."""
        return next((f for f, _ in UNITS if 1e-4 <= self.period * f < 0.1), None)
