# SPDX-License-Identifier: Apache-2.0
"""Writes a table as CSV or gzipped CSV."""

import csv
import gzip
import io
from collections.abc import Mapping
from pathlib import Path
from typing import BinaryIO, cast

import numpy as np

from touchline import _logs

_ROWS = 1 << 14  # that are written at a time


def write_csv(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns (N,) of numbers; each reads back to the last bit, and NaN is an empty cell.

    Args:
        path: what ends in `.gz` is compressed.
        columns: name -> (N,) numbers.
    """
    arrays = [np.asarray(column, np.float64) for column in columns.values()]
    head = io.StringIO()
    csv.writer(head, lineterminator="\n").writerow(columns)
    with path.open("wb") as raw:
        zipped = path.name.endswith(".gz")
        # No name and no time in the header: the same table gives the same bytes.
        gz = gzip.GzipFile("", "wb", 6, raw, mtime=0) if zipped else None
        file = cast(BinaryIO, gz or raw)
        file.write(head.getvalue().encode())
        for first in range(0, len(arrays[0]) if arrays else 0, _ROWS):
            rows = np.column_stack([array[first : first + _ROWS] for array in arrays])
            file.write(_logs.write_csv(np.ascontiguousarray(rows)))
        if gz is not None:
            gz.close()
