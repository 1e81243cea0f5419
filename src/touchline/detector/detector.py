# SPDX-License-Identifier: Apache-2.0
"""Detection of contacts and collisions on the residuals, one sample or a recording at a time."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from touchline.arrays import Array, Mask
from touchline.detector.residual_noise import native_noise
from touchline.detector.thresholds import Thresholds, make_thresholds
from touchline.model.robot import Robot
from touchline.native import core
from touchline.observer.observer import Estimate, Observer
from touchline.value import Value


class Level(IntEnum):
    """What a segment feels."""

    NONE = 0
    CONTACT = 1
    COLLISION = 2


@dataclass(frozen=True, eq=False, repr=False)
class Detection(Value):
    """The detector's view of one sample, or of N samples (N in front).

    Attributes:
        levels: (m,) the `Level` of each segment.
        normalized: (r,) each test's (residual - baseline) / contact threshold.
        drift: (r,) one sigma of what the model's errors may have added to each residual since
            its baseline, as the arm has moved on [N or Nm].
        quiet: (m,) over how long the baseline of each segment has been averaged [s].
    """

    levels: Array
    normalized: Array
    drift: Array
    quiet: Array

    @property
    def touched(self) -> Mask:
        """Whether any segment feels something, for each of N samples (N,)."""
        # Segment by segment: numpy's own reduction of short rows takes 60 times as long.
        touched = np.zeros(len(self.levels), bool)
        for level in self.levels.T:
            touched |= level > Level.NONE
        return touched


@dataclass(frozen=True)
class Details:
    """What the tests see of N samples, for those who set thresholds.

    Attributes:
        levels: (N, m) the `Level` of each segment.
        statistics: (N, m, t) each test's statistic, in the order of `Thresholds.limits`.
        residual: (N / every, r) residuals less their baseline [N or Nm]; NaN where not known.
        slow: (N / every, r) the same, low-passed once more.
        quick: (N / every, r) residuals less the mean of the last 0.2 s, low-passed once more.
        noise: (N / every, r) the variance of these two by the noise of the signals.
        activity: (N / every, 2) squared speed [rad2/s2], acceleration [rad/s2].
    """

    levels: Array
    statistics: Array
    residual: Array
    slow: Array
    quick: Array
    noise: Array
    activity: Array


def native_rows(thresholds: Thresholds) -> list[core.DetectionRow]:
    """What is tested, in the words of the native core."""
    return [core.DetectionRow(**vars(row)) for row in thresholds.rows]


def native_settings(robot: Robot, thresholds: Thresholds, period: float) -> core.DetectionSettings:
    """How it is tested, in the words of the native core; `period`: between samples [s]."""
    detection = robot.description.detection
    times = core.DetectionTimes(
        detection.min_duration, detection.hold, detection.baseline.time, detection.release
    )
    return core.DetectionSettings(
        [
            core.TestSetting(getattr(core.Test, method), limits.tolist())
            for method, limits in thresholds.limits.items()
        ],
        thresholds.sum_limit.tolist(),
        times,
        native_noise(robot, period),
        list(detection.windows),
    )


class Detector:
    """Runs an observer and tests its residuals (see the native `detector.hpp`).

    Args:
        observer: the observer; feed samples to the detector, not to both.
        thresholds: default: those of the robot's description.
        period: time between samples [s], for thresholds that follow from the noise.
    """

    def __init__(
        self, observer: Observer, thresholds: Thresholds | None = None, period: float = 1e-3
    ) -> None:
        self.observer = observer
        self.thresholds = thresholds or make_thresholds(observer.robot, period)
        self._core = core.Detector(
            observer.kernel,
            native_rows(self.thresholds),
            native_settings(observer.robot, self.thresholds, period),
        )

    def update(self, time, q, qd, tau=None, wrench=None) -> tuple[Estimate, Detection]:
        """One sample, arguments as for `Observer.update`."""
        signals = self.observer.arrays((), q, qd, tau, wrench)
        row, *judged = core.detect(self.observer.kernel, self._core, float(time), *signals)
        return self.observer.estimate(row), Detection(*judged)

    def run(self, time, q, qd, tau=None, wrench=None) -> tuple[Estimate, Detection]:
        """N samples, arguments as for `Observer.run`."""
        stamps = np.ascontiguousarray(time, dtype=float)
        signals = self.observer.arrays(stamps.shape, q, qd, tau, wrench)
        rows, *judged = core.detect_run(self.observer.kernel, self._core, stamps, *signals)
        return self.observer.estimate(rows), Detection(*judged)

    def details(self, time, q, qd, tau=None, wrench=None, every: int = 1) -> Details:
        """N samples, for those who set thresholds: what the tests see."""
        stamps = np.ascontiguousarray(time, dtype=float)
        signals = self.observer.arrays(stamps.shape, q, qd, tau, wrench)
        q, qd, tau, wrench = signals
        found = core.detect_details(
            self.observer.kernel, self._core, stamps, q, qd, tau, wrench, every
        )
        return Details(*found)
