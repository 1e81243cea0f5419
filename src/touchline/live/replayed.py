# SPDX-License-Identifier: Apache-2.0
"""`replay://LOG`: a recording as if its robot were running."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.live.pace import Pace, take_due
from touchline.live.sample import Sample
from touchline.live.source import Address
from touchline.live.streams import Stream
from touchline.logs import open_log
from touchline.logs.log import Log
from touchline.logs.period import sample_period
from touchline.model.robot import Robot

ROWS = 4096  # read at a time


class ReplayedLog:
    """A recording as a source.

    Args:
        address: `replay://LOG?speed=`; speed 1 is that of the robot, 0 as fast as possible.
        robot: that the recording is of.

    Raises:
        InputError: the recording cannot be read.
    """

    def __init__(self, address: Address, robot: Robot) -> None:
        address.only("speed")
        self.name, self._robot = address.text, robot
        self._speed = address.number("speed", 1.0)
        if not address.place:
            raise InputError(f"{address.text}: expected replay://LOG, the path of a recording")
        self._path = Path(address.place)
        with open_log(self._path, robot.description) as log:
            first = next(log.chunks(1 << 15), None)
            if first is None or not len(first):
                raise InputError(f"{self._path}: holds no samples")
            self.period: float | None = sample_period(log, first.time)
        self.streams = (Stream("recording", None if self._speed != 1.0 else self.period),)
        self._log: Log | None = None

    def open(self) -> list[str]:
        """Opens the recording."""
        self._log = open_log(self._path, self._robot.description)
        self._pace = Pace(_samples(self._log), self._speed)
        return list(self._log.warnings)

    def read(self, timeout: float) -> list[Sample]:
        """The samples that are due."""
        return take_due(self._pace, self.streams[0], timeout)

    def close(self) -> None:
        """Releases the file."""
        if self._log is not None:
            self._log.close()
            self._log = None


def _samples(log: Log) -> Iterator[Sample]:
    number = 0
    for part in log.chunks(ROWS):
        ages = np.zeros(part.wrench.shape[1])
        for i in range(len(part)):
            yield Sample(
                float(part.time[i]),
                part.q[i],
                part.qd[i],
                part.tau[i],
                part.wrench[i],
                sequence=number,
                ages=ages,
            )
            number += 1
