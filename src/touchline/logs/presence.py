# SPDX-License-Identifier: Apache-2.0
"""Whether a recording holds anything that could be judged at all."""

from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.observer.samples import Samples

LEAST_SAMPLES = 10  # fewer show neither a rate nor a motion


class Presence:
    """Counts what has a value while a recording is read.

    Attributes:
        samples: that were read.
        stamped: of them with a time that is a number.
        placed: with some joint's position; all of a robot without joints.
        moving: with the positions and velocities of all joints.
        felt: with some torque or force-torque reading.
    """

    def __init__(self) -> None:
        self.samples = self.stamped = self.placed = self.moving = self.felt = 0

    def add(self, part: Samples) -> None:
        """Take N samples."""
        self.samples += len(part)
        self.stamped += int(np.isfinite(part.time).sum())
        joints = part.q.shape[1]
        self.placed += int(np.isfinite(part.q).any(axis=1).sum()) if joints else len(part)
        self.moving += int(np.isfinite(np.concatenate([part.q, part.qd], axis=1)).all(axis=1).sum())
        felt = np.isfinite(part.tau).any(axis=1) | np.isfinite(part.wrench).any(axis=(1, 2))
        self.felt += int(felt.sum())

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
