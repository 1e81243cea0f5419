# SPDX-License-Identifier: Apache-2.0
"""Results of another run or method, to be shown beside those of an analysis."""

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.report.outputs import ESTIMATES, EVENTS

ROWS = 1 << 13  # at a time; bounds the memory


class Beside:
    """A folder that `touchline analyze` wrote.

    Attributes:
        folder: where it is.
        name: of the folder.
        columns: of its estimates.
        events: a dictionary per event, as in `events.json`.
        shift: what is added to its time [s].

    Raises:
        InputError: the folder holds no results.
    """

    def __init__(self, folder: Path) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.folder = folder
        self.name = folder.resolve().name
        self.shift = 0.0
        try:
            self.columns = set(pq.read_schema(folder / ESTIMATES).names)
            self.events: list[dict[str, Any]] = json.loads((folder / EVENTS).read_text("utf-8"))
            with pq.ParquetFile(folder / ESTIMATES) as file:
                time = file.read(columns=["time"])["time"].to_numpy()
        except (OSError, ValueError, KeyError, pa.ArrowException) as error:
            raise InputError(
                f"--beside {folder}: holds no results of `touchline analyze` ({error})"
            ) from None
        time = time[np.isfinite(time)]
        if not len(time):
            raise InputError(f"--beside {folder}: {ESTIMATES} has no sample")
        self.first, self.last = float(time[0]), float(time[-1])

    def place(self, first: float, last: float) -> None:
        """Lay it on a recording from `first` to `last` [s].

        Runs of different times begin together; those that overlap keep their time.
        """
        apart = self.last < first or self.first > last
        self.shift = first - self.first if apart else 0.0

    def read(self, names: Sequence[str]) -> Iterator[tuple[Array, Array]]:
        """Time (N,) [s], shifted, and columns (N, c) of its estimates, a part at a time."""
        import pyarrow.parquet as pq

        with pq.ParquetFile(self.folder / ESTIMATES) as file:
            for part in file.iter_batches(ROWS, columns=["time", *names]):
                values = [part[name].to_numpy(zero_copy_only=False) for name in names]
                time = part["time"].to_numpy(zero_copy_only=False)
                yield time + self.shift, np.column_stack(values)
