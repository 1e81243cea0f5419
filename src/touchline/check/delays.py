# SPDX-License-Identifier: Apache-2.0
"""How late readings come beside the positions: reading = expected - delay * its rate."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.check.fit import robust_line

LATE = 2e-3  # s; smaller delays are told as a figure, not as a finding
SURE = 5.0  # standard errors
GAIN_OFF = 0.2  # what reads so much more or less is not the expected load, whose rate says nothing


@dataclass(frozen=True)
class Lateness:
    """A delay that several channels share [s], with one standard error."""

    value: float
    error: float

    @property
    def sure(self) -> bool:
        """Is it long enough to be mended, and known?"""
        return self.value > max(LATE, SURE * self.error)

    @property
    def words(self) -> str:
        """For notes and findings."""
        return f"{1e3 * self.value:.2f} +- {1e3 * max(self.error, 1e-5):.2f} ms"


def common_delay(known: Sequence[tuple[float, float]]) -> Lateness | None:
    """What channels share: a model's errors do not agree on one delay.

    Args:
        known: of each channel, with its standard error [s].

    Returns:
        None of less than two channels.
    """
    if len(known) < 2:
        return None
    delays, errors = np.array(known).T
    weight = np.maximum(errors, 1e-6) ** -2.0
    common = float((weight * delays).sum() / weight.sum())
    spread = max(1.0, float(np.sqrt((weight * (delays - common) ** 2).sum() / (len(known) - 1))))
    return Lateness(common, spread * float(weight.sum()) ** -0.5)


def axis_delays(
    reading: Array, expected: Array, rate: Array, period: float
) -> list[tuple[float, float]]:
    """Delays of those axes of a sensor that tell one, with their standard errors [s].

    A load whose centre is not the model's moves moments as the forces go: all expected forces are
    free beside a moment, and an offset beside all.

    Args:
        reading: (W, 6) [N, Nm], in the axes of the sensor.
        expected: (W, 6) without contact.
        rate: (W, 6) how fast that changes.
        period: of the samples [s].
    """
    known = []
    for axis in range(6):
        beside = [expected[:, axis]] if axis < 3 else [expected[:, axis], *expected[:, :3].T]
        columns = [rate[:, axis], *beside, np.ones(len(expected))]
        X, y = np.column_stack(columns), reading[:, axis]
        usable = np.isfinite(X).all(axis=1) & np.isfinite(y)
        X, y = X[usable], y[usable]
        if len(y) < 4 * X.shape[1] or np.ptp(X[:, 1]) == 0.0:
            continue
        line = robust_line(X, y)
        if line is None:
            continue
        factor = float(line.coefficients[1])
        if axis < 3 and abs(factor - 1) > GAIN_OFF:
            continue
        # The expectation is a mean over the interval before each sample, half a period early.
        value = 0.5 * period - float(line.coefficients[0]) / (factor if axis < 3 else 1.0)
        error = float(line.errors[0])
        if np.isfinite(value) and np.isfinite(error) and error > 0.0:
            known.append((value, error))
    return known
