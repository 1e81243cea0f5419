# SPDX-License-Identifier: Apache-2.0
"""The recordings that a calibration reads several times over."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from touchline.detector.thresholds import PERIOD_RATIO
from touchline.errors import InputError
from touchline.logs import open_log
from touchline.logs.period import typical_period
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

CHUNK = 1 << 15  # samples
LEAST_SECONDS = 20.0  # shorter ones have no tail


class Recordings:
    """The logs, to be read as often as needed."""

    def __init__(self, robot: Robot, logs: list[Path]) -> None:
        self._robot, self._logs = robot, logs
        self.period = float("nan")
        seconds = 0.0
        for log in logs:
            period, length = self._look_at(log)
            if not np.isfinite(self.period):
                self.period = period
            if not 1 / PERIOD_RATIO < period / self.period < PERIOD_RATIO:
                raise InputError(
                    f"{log}: has {1 / period:g} samples a second, {logs[0]} has "
                    f"{1 / self.period:g}: thresholds hold for one rate"
                )
            seconds += length
        if seconds < LEAST_SECONDS:
            raise InputError(
                f"{', '.join(map(str, logs))}: {seconds:.3g} s of samples; at least "
                f"{LEAST_SECONDS:g} s are needed, an hour is better"
            )

    def _look_at(self, log: Path) -> tuple[float, float]:
        period, samples = float("nan"), 0
        with open_log(log, self._robot.description) as recording:
            for part in recording.chunks(CHUNK):
                if not np.isfinite(period):
                    period = typical_period(part.time)
                samples += len(part.time)
        if not samples:
            raise InputError(f"{log}: holds no samples")
        return period, samples * period

    def all(self, what: str) -> Iterator[Iterator[Samples]]:
        """Every recording, in parts."""
        from tqdm import tqdm

        for log in tqdm(self._logs, desc=what, disable=None, leave=False):
            yield self._parts(log)

    def of(self, number: int) -> Iterator[Samples]:
        """One recording, in parts."""
        return self._parts(self._logs[number])

    def _parts(self, log: Path) -> Iterator[Samples]:
        with open_log(log, self._robot.description) as recording:
            yield from recording.chunks(CHUNK)
