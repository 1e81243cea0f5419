# SPDX-License-Identifier: Apache-2.0
"""What thresholds do on data that they were not made from."""

from dataclasses import dataclass

import numpy as np

from touchline.detector.calibration import Statistics, count_alarms, fit_tails
from touchline.detector.tail import poisson_interval
from touchline.model.robot import Robot
from touchline.model.values import METHODS

HELD_OUT = 3  # every third recording, or the last third of a single one
RATES = (100.0, 10.0)  # per hour, at which held-out data are judged beside the wanted rate
LEAST_PEAKS = 10  # of a tail from part of the data, which serves this check alone
EXPECTED = 1.0, 10.0  # alarms: fewer tell nothing; rates that let so many be expected tell most


@dataclass(frozen=True)
class HeldOut:
    """What a method's thresholds, from the other data, did on the data held out.

    Attributes:
        method: of detection.
        rate: false alarms per hour that the thresholds are for.
        count: alarms that came.
        hours: in which they came.
    """

    method: str
    rate: float
    count: int
    hours: float

    @property
    def measured(self) -> float:
        """Alarms per hour."""
        return self.count / self.hours

    @property
    def interval(self) -> tuple[float, float]:
        """95 % Poisson interval of the rate [1/h]."""
        low, high = poisson_interval(self.count)
        return low / self.hours, high / self.hours


def split(found: Statistics, logs: int) -> tuple[Statistics, Statistics, str]:
    """What thresholds are made from, what they are judged on, and how the two were parted."""
    if logs >= HELD_OUT:
        out = found.recording % HELD_OUT == HELD_OUT - 1
        how = f"every {HELD_OUT}rd recording held out"
    else:
        length = np.zeros(logs)
        for i in range(logs):
            length[i] = np.count_nonzero(found.recording == i)
        place = np.concatenate([np.arange(n) / n for n in length])
        out = place >= 1.0 - 1.0 / HELD_OUT
        how = "the last third of each recording held out"
    return found.part(~out), found.part(out), how


def judge(robot: Robot, train: Statistics, test: Statistics, wanted: float) -> list[HeldOut]:
    """The alarms of every method on held-out data, at the rates that have something to show."""
    tails = fit_tails(robot, train, least=LEAST_PEAKS)
    names = [name for name in robot.segment_names if name in tails]
    most = min((t.per_hour for of in tails.values() for t in of.values()), default=0.0) * len(names)
    telling = float(f"{min(most, EXPECTED[1] / test.hours):.2g}")
    rates = [max(telling, RATES[0]), *RATES]
    shown = [rate for rate in rates if EXPECTED[0] / test.hours <= rate <= most]
    judged = []
    for t, method in enumerate(METHODS):
        for rate in dict.fromkeys((*shown, wanted)):
            of = [tails.get(name, {}).get(method) for name in robot.segment_names]
            if not any(of):
                continue
            limits = np.array([x.threshold(rate / len(names)) if x else np.inf for x in of])
            judged.append(HeldOut(method, rate, count_alarms(test, limits, t), test.hours))
    return judged
