# SPDX-License-Identifier: Apache-2.0
"""A Parquet table with a column `time`, read piece by piece as it is asked for."""

from collections import OrderedDict
from pathlib import Path
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from touchline.errors import InputError
from touchline.logs.parquet import damages, first_line, read_first_rows

MOST_HELD = 160  # pieces of columns in memory, at most 1 MB each


class TimedTable:
    """A table whose rows lie in groups of some 100,000.

    Args:
        path: of the Parquet file.

    Attributes:
        columns: names of its columns, `time` first.
        rows: number of its rows.
        groups: number of its groups of rows.

    Raises:
        InputError: it cannot be read, or is no such table.
    """

    def __init__(self, path: Path) -> None:
        import pyarrow.parquet as pq

        try:
            self._file = pq.ParquetFile(path)
            self.columns = tuple(self._file.schema_arrow.names)
            read_first_rows(self._file, "time")
        except damages() as error:
            raise InputError(f"{path}: cannot be read: {first_line(error)}") from error
        self.path = path
        if self.columns[:1] != ("time",):
            raise InputError(f"{path}: its first column is not 'time'; analyze again")
        metadata = self._file.metadata
        self.rows, self.groups = metadata.num_rows, metadata.num_row_groups
        self._spans = [self._span(group) for group in range(self.groups)]
        self._held: OrderedDict[tuple[str, int], NDArray] = OrderedDict()
        self._lock = Lock()

    def _span(self, group: int) -> tuple[float, float]:
        """Least and largest time of a group, as the file tells; all of time where it does not."""
        told = self._file.metadata.row_group(group).column(0).statistics
        if told is None or not told.has_min_max:
            return -np.inf, np.inf
        return float(told.min), float(told.max)

    def groups_between(self, begin: float, end: float) -> list[int]:
        """Numbers of the groups that may hold rows of a piece of time [s]."""
        return [g for g, (low, high) in enumerate(self._spans) if low <= end and high >= begin]

    def values(self, column: str, group: int) -> NDArray:
        """One column of one group: numbers with NaN for null, text with None."""
        key = (column, group)
        with self._lock:
            if key not in self._held:
                self._held[key] = self._read(column, group)
                if len(self._held) > MOST_HELD:
                    self._held.popitem(last=False)
            self._held.move_to_end(key)
            return self._held[key]

    def _read(self, column: str, group: int) -> NDArray:
        import pyarrow as pa

        try:
            found = self._file.read_row_group(group, columns=[column]).column(0)
        except (OSError, KeyError, pa.ArrowInvalid) as error:
            raise InputError(f"{self.path}: column '{column}' cannot be read: {error}") from error
        return found.to_numpy()
