# SPDX-License-Identifier: Apache-2.0
"""Whether a recording holds anything that could be judged at all."""

from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.observer.samples import Samples

LEAST_SAMPLES = 10  # fewer show neither a rate nor a motion
MOST_UNORDERED = 0.5  # of the samples: where more stamps do not rise, the clock is wrong


class Presence:
    """Counts what has a value while a recording is read.

    Attributes:
        samples: that were read.
        stamped: of them with a time that is a number.
        placed: with some joint's position; all of a robot without joints.
        moving: with the positions and velocities of all joints.
        felt: with some torque or force-torque reading.
        unordered: with a time that is not later than all before.
        first_unordered: row of the first of these, counted from 0; -1: none.
        lacking: of `q`, `qd`, `tau`, how many samples of each joint (n,) are no numbers.
    """

    def __init__(self) -> None:
        self.samples = self.stamped = self.placed = self.moving = self.felt = 0
        self.unordered, self.first_unordered = 0, -1
        self.lacking = {signal: np.zeros(0, dtype=int) for signal in ("q", "qd", "tau")}
        self._latest = -np.inf

    def add(self, part: Samples) -> None:
        """Take N samples."""
        self.samples += len(part)
        self.stamped += int(np.isfinite(part.time).sum())
        joints = part.q.shape[1]
        self.placed += int(np.isfinite(part.q).any(axis=1).sum()) if joints else len(part)
        self.moving += int(np.isfinite(np.concatenate([part.q, part.qd], axis=1)).all(axis=1).sum())
        felt = np.isfinite(part.tau).any(axis=1) | np.isfinite(part.wrench).any(axis=(1, 2))
        self.felt += int(felt.sum())
        self._add_stamps(part)
        for signal, count in self.lacking.items():
            missing = (~np.isfinite(getattr(part, signal))).sum(axis=0)
            self.lacking[signal] = missing + count if len(count) else missing

    def _add_stamps(self, part: Samples) -> None:
        known = np.isfinite(part.time)
        latest = np.maximum.accumulate(
            np.concatenate([[self._latest], np.where(known, part.time, -np.inf)])
        )
        late = np.flatnonzero(known & (part.time <= latest[:-1]))
        self._latest = float(latest[-1])
        self.unordered += len(late)
        if len(late) and self.first_unordered < 0:
            self.first_unordered = part.row + int(late[0])

    @property
    def unordered_words(self) -> str:
        """How many stamps do not rise, and from where on."""
        return (
            f"{self.unordered} of {self.samples} time stamps are not later than all before them, "
            f"the first in row {self.first_unordered}"
        )

    def refuse_unordered(self, log: Path) -> None:
        """Refuses a recording whose stamps stand still or go back.

        Raises:
            InputError: how many of them, from which row on, and what to do.
        """
        if self.unordered > MOST_UNORDERED * self.samples:
            raise InputError(
                f"{log}: {self.unordered_words}: such samples tell nothing. Does `log: time` name "
                "the clock of the samples? Write the rows in the order of their stamps, each log "
                "by itself, or record anew"
            )

    def refuse_void(self, log: Path) -> None:
        """Refuses a recording of which nothing could be said.

        Raises:
            InputError: what is missing, and what to do.
        """
        if self.samples < LEAST_SAMPLES:
            raise InputError(
                f"{log}: holds {self.samples} sample{'s' * (self.samples != 1)}, "
                f"{LEAST_SAMPLES} at least are needed: record anew"
            )
        for count, what, key in (
            (self.stamped, "time stamp is a number", "time"),
            (self.placed, "joint has a position that is a number", "q"),
            (self.felt, "torque or force-torque reading is a number", "tau, wrench"),
        ):
            if not count:
                raise InputError(
                    f"{log}: no {what}: were the signals recorded, and do the keys of `log` "
                    f"({key}) name them? Record anew, or name them there"
                )
