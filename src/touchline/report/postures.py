# SPDX-License-Identifier: Apache-2.0
"""How the arm stood during a recording, as often as a replay needs."""

from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.logs import TableWriter
from touchline.model.robot import Robot

RATE = 100.0  # postures per second, at most; a replay goes straight between them


class PostureWriter:
    """Writes `postures.parquet`: `time` [s] and `q.JOINT`, without what was not measured.

    Args:
        path: of the file.
        robot: the robot.
    """

    def __init__(self, path: Path, robot: Robot) -> None:
        self._names = [f"q.{name}" for name in robot.joint_names]
        self._table = TableWriter(path, dict.fromkeys(("time", *self._names), "f8"))
        self._last = np.nan

    def add(self, time: Array, q: Array) -> None:
        """Take N samples: `time` (N,) [s], `q` (N, n) [rad or m]."""
        usable = np.isfinite(time) & np.isfinite(q).all(axis=1)
        time, q = time[usable], q[usable]
        if not len(time):
            return
        slot = np.floor(time * RATE)
        first = slot != np.concatenate([[self._last], slot[:-1]])
        self._last = slot[-1]
        columns = dict(zip(self._names, q[first].T, strict=True))
        self._table.write({"time": time[first], **columns})

    def close(self) -> None:
        """Finish the file."""
        self._table.close()
