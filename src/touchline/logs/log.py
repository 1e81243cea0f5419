# SPDX-License-Identifier: Apache-2.0
"""Opens a recording of any supported kind and hands out its samples."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, Self

import numpy as np

from touchline.errors import InputError
from touchline.logs.blocks import windows
from touchline.logs.columns import signal_shapes
from touchline.logs.mcap import read_metadata
from touchline.logs.naming import parse_naming
from touchline.logs.period import RECORDER, RECORDER_KEY
from touchline.logs.prepare import Preparation
from touchline.logs.source import Source
from touchline.logs.writer import mend_table
from touchline.model.description import RobotDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

TABLES = (".parquet", ".csv", ".csv.gz")
BAGS = (".db3", ".mcap")


class Log:
    """An opened recording.

    Attributes:
        path: of the log.
        rows: number of rows, None where it is only known at the end.
        duration: [s], None where it is only known at the end.
        columns: columns of the table.
        topics: topic -> message type of the rosbag2.
        metadata: what the writer left (Parquet).
    """

    def __init__(self, path: Path, description: RobotDescription, source: Source):
        self.path = path
        self._source = source
        self._preparation = Preparation(path, description, source)
        self.rows = source.rows
        self.duration = source.duration
        self.columns = source.columns
        self.topics = source.topics
        self.metadata: dict[str, Any] = source.metadata

    @property
    def warnings(self) -> list[str]:
        """What the user should know; grows while the log is read."""
        return self._preparation.warnings + self._source.warnings

    @property
    def losses(self) -> list[str]:
        """The warnings that tell of parts of the log that could not be read."""
        return self._source.losses

    @property
    def progress(self) -> float:
        """Fraction of the log that has been read, 0 to 1."""
        return min(self._source.progress(), 1.0)

    def chunks(self, rows: int = 65536) -> Iterator[Samples]:
        """All samples, `rows` at a time (the last may be fewer); the numbers do not depend on it.

        Raises:
            InputError: the log is damaged or holds something that is no number.
            ValueError: `rows` is not positive.
        """
        if rows < 1:
            raise ValueError(f"chunks of {rows} rows")
        for window in windows(self._source.blocks(), rows, self._preparation.halo):
            yield self._preparation.samples(window)

    def close(self) -> None:
        """Release the file."""
        self._source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def open_log(path: Path | str, description: RobotDescription) -> Log:
    """Open a table (Parquet, CSV, CSV.gz) or a rosbag2 (sqlite3, MCAP).

    Raises:
        InputError: the file is missing, of no known kind, empty or unreadable, or lacks columns
            or topics the robot needs.
    """
    path = Path(path)
    mended = path.suffix == ".parquet" and mend_table(path)
    source = _open_source(path, description)
    if mended:
        source.warnings.append(
            f"{path}: its recorder was killed; put together from {path.stem}.parts"
        )
    try:
        return Log(path, description, source)
    except BaseException:
        source.close()
        raise


def _open_source(path: Path, description: RobotDescription) -> Source:
    if not path.exists():
        raise InputError(f"{path}: no such file")
    if _recorded_live(path):  # in the contract's names and units, whatever the robot's are
        description = replace(description, log={})
    naming = parse_naming(description)
    name = path.name.lower()
    if path.is_file() and not path.stat().st_size:
        raise InputError(f"{path}: the file is empty")
    if is_bag(path):
        from touchline.logs.rosbag import RosbagSource

        return RosbagSource(path, description, naming)
    if name.endswith(".parquet"):
        from touchline.logs.parquet import ParquetSource

        return ParquetSource(path, description, naming)
    if name.endswith((".csv", ".csv.gz")):
        from touchline.logs.csvfile import CsvSource

        return CsvSource(path, description, naming)
    raise unknown_kind(path)


def is_bag(path: Path) -> bool:
    """Is a log a rosbag2 recording rather than a table?"""
    return path.is_dir() or path.name.lower().endswith(BAGS)


def unknown_kind(path: Path) -> InputError:
    """What is said of a file that is no recording of a kind that is read."""
    if path.suffix == ".bag":
        return InputError(
            f"{path}: a bag of ROS 1 is not read; this makes a rosbag2 of it (package rosbags): "
            f"rosbags-convert --src {path} --dst {path.with_suffix('')}"
        )
    return InputError(
        f"{path}: not a known kind of log; tables end in {', '.join(TABLES)}, recordings in "
        f"{', '.join(BAGS)} (a rosbag2 folder holds a metadata.yaml)"
    )


def _recorded_live(path: Path) -> bool:
    if path.is_file() and path.suffix == ".mcap":
        return RECORDER_KEY in read_metadata(path)
    if path.is_file() and path.suffix == ".parquet":
        from touchline.logs.parquet import table_metadata

        return table_metadata(path).get(RECORDER_KEY) == RECORDER
    return False


def read_log(path: Path | str, robot: Robot | RobotDescription) -> Samples:
    """Read all samples of a recording at once.

    Args:
        path: a table (.parquet, .csv, .csv.gz) or a rosbag2 (.mcap, .db3, or its folder).
        robot: the robot, or its description.

    Returns:
        `time` (N,) [s], `q`, `qd`, `tau` (N, n) and `wrench` (N, k, 6), NaN where not measured.

    Raises:
        InputError: as `open_log` and `Log.chunks`.
    """
    description = robot.description if isinstance(robot, Robot) else robot
    with open_log(path, description) as log:
        chunks = list(log.chunks())
    if not chunks:
        empty = {n: np.empty((0, *shape)) for n, shape in signal_shapes(description).items()}
        return Samples(**empty, row=0)
    names = ("time", "q", "qd", "tau", "wrench")
    return Samples(**{n: np.concatenate([getattr(c, n) for c in chunks]) for n in names}, row=0)
