# SPDX-License-Identifier: Apache-2.0
"""What every kind of log offers to `Log`."""

from collections.abc import Iterator
from typing import Any, Protocol

from touchline.logs.blocks import Block

HEAD_ROWS = 4096


class Source(Protocol):
    """One opened log.

    Attributes:
        rows: number of rows, None where it is only known at the end.
        duration: [s], None where it is only known at the end.
        columns: the table's columns.
        topics: topic -> message type, of a rosbag2.
        metadata: what the writer left.
        warnings: grows while reading.
        losses: those of them that tell of parts that could not be read.
        without_velocity: indices of the joints whose `qd` is not in the log.
        delayed_wrenches: True where `blocks` leaves the sensors' delays to the reader.
    """

    columns: tuple[str, ...]
    topics: dict[str, str]
    metadata: dict[str, Any]
    without_velocity: tuple[int, ...]
    delayed_wrenches: bool

    @property
    def rows(self) -> int | None: ...  # noqa: D102

    @property
    def duration(self) -> float | None: ...  # noqa: D102

    @property
    def warnings(self) -> list[str]: ...  # noqa: D102

    @property
    def losses(self) -> list[str]: ...  # noqa: D102

    def head(self) -> Block:
        """The first rows, at most `HEAD_ROWS`."""
        ...

    def blocks(self) -> Iterator[Block]:
        """All rows, with `time`, `q`, `qd`, `tau` and `wrench`."""
        ...

    def progress(self) -> float:
        """Fraction of the log that has been read, 0 to 1."""
        ...

    def close(self) -> None:
        """Release the file."""
        ...
