# SPDX-License-Identifier: Apache-2.0
"""Detection of contacts and collisions on the residuals, one sample or a recording at a time."""

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from touchline.contact.thresholds import Thresholds, make_thresholds
from touchline.estimation.observer import Estimate, Observer
from touchline.native import core

Array = NDArray[np.float64]


class Level(IntEnum):
    """What a segment feels."""

    NONE = 0
    CONTACT = 1
    COLLISION = 2


@dataclass(frozen=True)
class Detection:
    """The detector's view of one sample, or of N samples (N in front).

    Attributes:
        levels: (m,) the `Level` of each segment.
        normalized: (r,) each test's (residual - baseline) / contact threshold.
        quiet: (m,) over how long the baseline of each segment has been averaged [s].
    """

    levels: Array
    normalized: Array
    quiet: Array


class Detector:
    """Runs an observer and tests its residuals (see `core/include/touchline/detector.hpp`).

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
        settings = observer.robot.description.detection
        self._core = core.Detector(
            observer.kernel,
            [core.DetectionRow(**vars(row)) for row in self.thresholds.rows],
            self.thresholds.sum_limit.tolist(),
            core.DetectionTimes(
                settings.min_duration, settings.hold, settings.baseline.time, settings.release
            ),
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
