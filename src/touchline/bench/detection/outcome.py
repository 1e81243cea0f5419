# SPDX-License-Identifier: Apache-2.0
"""What the detection benchmark measured in one setting: alarms and delays at any rate."""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.bench.detection.work import Setting, description
from touchline.detector.calibration import Statistics, count_alarms
from touchline.detector.tail import Tail

GOALS = {
    (1000.0, 1e-3): (20.0, 6e-3),
    (8000.0, 1e-3): (20.0, 4e-3),
    (1000.0, 2e-4): (5.0, 15e-3),
    (8000.0, 2e-4): (5.0, 10e-3),
}


@dataclass(frozen=True)
class Outcome:
    """What was measured in one setting.

    Attributes:
        setting: what was simulated.
        methods: of detection, in the order of the statistics.
        tails: by segment and method, from the calibration.
        tested: statistics on other trajectories.
        pushes: force -> statistics (trials, samples, methods) on the structure from its onset on.
        hours: of calibration.
    """

    setting: Setting
    methods: tuple[str, ...]
    tails: dict[str, dict[str, Tail]]
    tested: Statistics
    pushes: dict[float, Array]
    hours: float

    def limits(self, method: str, rate: float) -> Array:
        """Thresholds of the segments for a false-alarm rate of the whole robot."""
        robot = description(self.setting.layout, self.setting.velocity)
        share = rate / len(robot.segment_names)
        tails = [self.tails.get(name, {}).get(method) for name in robot.segment_names]
        return np.array([tail.threshold(share) if tail else np.inf for tail in tails])

    def alarms(self, method: str, rate: float) -> int:
        """Alarms in the tested hours."""
        return count_alarms(self.tested, self.limits(method, rate), self.methods.index(method))

    def delays(self, method: str, force: float, rate: float) -> Array:
        """Time (trials,) from the onset to the detection [s]; infinite where it never came."""
        over = self.pushes[force][:, :, self.methods.index(method)] > self.limits(method, rate)[0]
        over &= ~over[:, :1]  # an alarm before the onset finds nothing
        first = (np.argmax(over, axis=1) - 0.5) / self.setting.rate
        return np.where(over.any(axis=1), first, np.inf)

    @property
    def goal(self) -> tuple[float, float]:
        """A force [N] and the time [s] in which it shall be found."""
        return GOALS[self.setting.rate, self.setting.velocity]


def percentile(delays: Array) -> float:
    """Time within which 95 % of the pushes are found [s]."""
    return float(np.sort(delays)[int(np.ceil(0.95 * len(delays))) - 1])
