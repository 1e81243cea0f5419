# SPDX-License-Identifier: Apache-2.0
"""The recordings that a calibration reads several times over."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from touchline.calibrate.lacking import joints_lacking, signal_words, uncalibrated_words
from touchline.detector.thresholds import PERIOD_RATIO
from touchline.errors import InputError
from touchline.logs import open_log
from touchline.logs.period import typical_period
from touchline.logs.presence import Presence
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

CHUNK = 1 << 15  # samples
LEAST_SECONDS = 5.0  # shorter ones tell an offset at best
FEW = 0.005  # of the samples; losses below it change nothing, as for `touchline check`
BESIDE = 0.3  # s on either side of a stretch that is left out


class Recordings:
    """The logs, to be read as often as needed.

    Attributes:
        seconds: of samples that are not left out.
        period: of the samples [s].
        samples: that the logs hold.
        moving: of them with the positions and velocities of all joints.
        travel: of the joint that comes farthest, over all logs [rad or m]; 0 without joints.
        losses: what is said of parts of the logs that cannot be read.
        lacking: by `q` and `qd`, whose are no numbers in most samples of a log.
    """

    def __init__(self, robot: Robot, logs: list[Path]) -> None:
        self._robot, self._logs = robot, logs
        self._left_out: list[tuple[int, float, float]] = []
        self.losses: list[str] = []
        self.lacking: dict[str, str] = {}
        self.seconds = 0.0
        self.samples = self.moving = 0
        self.period = float("nan")
        joints = len(robot.joint_names)
        self._least, self._most = np.full(joints, np.inf), np.full(joints, -np.inf)
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
        self.seconds = seconds
        if seconds < LEAST_SECONDS:
            raise InputError(
                f"{', '.join(map(str, logs))}: {seconds:.3g} s of samples; at least "
                f"{LEAST_SECONDS:g} s are needed, half an hour is better"
            )

    def _look_at(self, log: Path) -> tuple[float, float]:
        period, present = float("nan"), Presence()
        with open_log(log, self._robot.description) as recording:
            for part in recording.chunks(CHUNK):
                if not np.isfinite(period):
                    period = typical_period(part.time)
                present.add(part)
                self._least = np.fmin(self._least, np.fmin.reduce(part.q, axis=0, initial=np.inf))
                self._most = np.fmax(self._most, np.fmax.reduce(part.q, axis=0, initial=-np.inf))
            self.losses += recording.losses
            columns = recording.columns
        present.refuse_void(log)
        present.refuse_unordered(log)
        if present.unordered > FEW * present.samples:
            self.losses.append(f"{log}: {present.unordered_words}: they are left out")
        told = uncalibrated_words(self._robot.description, present, columns)
        if told is not None:
            self.losses.append(f"{log}: {told}")
        for signal in ("q", "qd"):
            joints = joints_lacking(self._robot.description, present, signal)
            if len(joints):
                words = signal_words(self._robot.description, signal, joints, columns)
                self.lacking.setdefault(signal, words)
        self.samples += present.samples
        self.moving += present.moving
        return period, present.samples * period

    @property
    def travel(self) -> float:
        """See the class."""
        return float(np.max(self._most - self._least, initial=0.0))

    def all(self, what: str) -> Iterator[Iterator[Samples]]:
        """Every recording, in parts."""
        from tqdm import tqdm

        for i in tqdm(range(len(self._logs)), desc=what, disable=None, leave=False):
            yield self._parts(i)

    def of(self, number: int) -> Iterator[Samples]:
        """One recording, in parts."""
        return self._parts(number)

    def leave_out(self, stretches: list[tuple[int, float, float]]) -> None:
        """Reads on as if nothing had been recorded in some stretches.

        Args:
            stretches: number of the recording, begin and end [s].
        """
        self._left_out += stretches
        self.seconds = sum(
            len(part) * self.period for i in range(len(self._logs)) for part in self._parts(i)
        )

    def _parts(self, number: int) -> Iterator[Samples]:
        stretches = [(a - BESIDE, b + BESIDE) for i, a, b in self._left_out if i == number]
        with open_log(self._logs[number], self._robot.description) as recording:
            for part in recording.chunks(CHUNK):
                keep = np.ones(len(part), dtype=bool)
                for start, end in stretches:
                    keep &= (part.time < start) | (part.time > end)
                yield part if keep.all() else part.where(keep)
