# SPDX-License-Identifier: Apache-2.0
"""Reads a table from a Parquet file in bounded memory."""

import json
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.logs.blocks import Block
from touchline.logs.clock import in_seconds
from touchline.logs.columns import select_columns
from touchline.logs.naming import Naming
from touchline.logs.source import HEAD_ROWS
from touchline.model.description import RobotDescription

METADATA_KEY = b"touchline"
_BATCH_ROWS = 1 << 14
_WHOLE = 64 << 20  # bytes; an hour of 1 kHz in one row group is larger
_STREAM = 1 << 20  # bytes


class ParquetSource:
    """A Parquet file as a log."""

    def __init__(self, path: Path, description: RobotDescription, naming: Naming):
        """Open the file and find its columns.

        Raises:
            InputError: no Parquet file, one cut off before its footer, no rows, or columns are
                missing.
        """
        import pyarrow.parquet as pq

        self.path = path
        try:
            metadata = pq.read_metadata(path)
            self._file = pq.ParquetFile(
                path,
                metadata=metadata,
                pre_buffer=False,
                buffer_size=_stream(metadata),
                page_checksum_verification=True,
            )
            self.columns = tuple(self._file.schema_arrow.names)
        except damages() as error:
            raise InputError(
                f"{path}: not a readable Parquet file; a file cut off before its footer cannot "
                f"be read ({first_line(error)})"
            ) from error
        self.topics: dict[str, str] = {}
        self.warnings: list[str] = []
        self.losses: list[str] = []
        self.delayed_wrenches = True
        try:
            self._selection = select_columns(description, naming, list(self.columns), str(path))
            self._check_types(naming.time.name)
            naming = in_seconds(
                naming,
                path,
                self.warnings,
                lambda: self._first_stamps(naming.time.name),
                self._unit(naming),
            )
            self._selection = select_columns(description, naming, list(self.columns), str(path))
            if not self._file.metadata.num_rows:
                raise InputError(f"{path}: the table has no rows")
        except InputError:
            self.close()
            raise
        self.without_velocity = self._selection.without_velocity
        self.rows = self._file.metadata.num_rows
        self.metadata = _metadata(self._file.schema_arrow.metadata or {})
        try:
            self.duration = self._duration(naming)
        except damages() as error:
            self.close()
            raise InputError(f"{path}: damaged footer: {first_line(error)}") from error
        self._read_rows = 0

    def _unit(self, naming: Naming) -> str | None:
        """The unit of the stamps, where they are dates."""
        kind = self._file.schema_arrow.field(naming.time.name).type
        return getattr(kind, "unit", None)

    def _check_types(self, time: str) -> None:
        import pyarrow.types as types

        problems = []
        for name in self._selection.names:
            kind = self._file.schema_arrow.field(name).type
            fits = types.is_floating(kind) or types.is_integer(kind) or types.is_null(kind)
            if not fits and not (name == time and types.is_timestamp(kind)):
                problems.append(f"{self.path}: column {name!r} holds {kind}, not numbers")
        if problems:
            raise InputError(problems)

    def _duration(self, naming: Naming) -> float | None:
        """From the statistics of the time column, where the writer left them."""
        at = next(
            (i for i, column in enumerate(self._file.schema) if column.path == naming.time.name),
            None,
        )
        if at is None:
            return None
        meta = self._file.metadata
        read_first_rows(self._file, naming.time.name)
        chunks = [meta.row_group(g).column(at).statistics for g in range(meta.num_row_groups)]
        ranges = [(s.min_raw, s.max_raw) for s in chunks if s is not None and s.has_min_max]
        if not ranges or len(ranges) < len(chunks):
            return None
        span = max(high for _, high in ranges) - min(low for low, _ in ranges)
        return float(span) * abs(naming.time.factor)

    def head(self) -> Block:
        """The first rows."""
        return next(self._blocks(HEAD_ROWS), self._selection.assemble(lambda _: np.empty(0), 0))

    def _first_stamps(self, time: str) -> np.ndarray:
        """As they are written; no other column is unpacked for them."""
        try:
            batches = self._file.iter_batches(batch_size=HEAD_ROWS, columns=[time])
            return next((numbers(batch.column(time)) for batch in batches), np.empty(0))
        except damages() as error:
            raise InputError(f"{self.path}: damaged after row 0: {first_line(error)}") from error

    def blocks(self) -> Iterator[Block]:
        """All rows.

        Raises:
            InputError: a page of the file is damaged.
        """
        self._read_rows = 0
        for block in self._blocks(_BATCH_ROWS):
            self._read_rows += len(block["time"])
            yield block

    def _blocks(self, rows: int) -> Iterator[Block]:
        done = 0
        try:
            for batch in self._file.iter_batches(batch_size=rows, columns=self._selection.names):
                yield self._selection.assemble(
                    lambda name, batch=batch: numbers(batch.column(name)), batch.num_rows
                )
                done += batch.num_rows
        except InputError:
            raise
        except damages() as error:
            raise InputError(
                f"{self.path}: damaged after row {done}: {first_line(error)}"
            ) from error

    def progress(self) -> float:
        """Fraction of the rows read."""
        return self._read_rows / self.rows if self.rows else 1.0

    def close(self) -> None:
        """Release the file."""
        self._file.close(force=True)


def read_first_rows(file: Any, column: str) -> None:
    """Reads a row of each group of an open Parquet file.

    pyarrow ends the process where it is asked for statistics of a damaged column, but raises an
    error where it reads the column: so this goes first.

    Raises:
        Exception: one of `damages()`.
    """
    for group in range(file.metadata.num_row_groups):
        next(file.iter_batches(1, [group], [column]), None)


def _stream(metadata: Any) -> int:
    """Bytes that are read at a time; 0: a column of a row group at once.

    A huge row group is read page by page. Room is made for as much as a page claims to hold, which
    in a damaged file may be anything: so small row groups are read whole.
    """
    # Not by column: pyarrow ends the process at some damaged columns of a footer.
    sizes = [metadata.row_group(g).total_byte_size for g in range(metadata.num_row_groups)]
    return 0 if max(sizes, default=0) < _WHOLE else _STREAM


def damages() -> tuple[type[Exception], ...]:
    """What pyarrow raises for a damaged file: names that are no text, sizes that no memory has."""
    import pyarrow as pa

    return pa.ArrowException, OSError, ValueError, MemoryError, OverflowError


def first_line(error: Exception) -> str:
    """What an error says, in one line."""
    return next(iter(str(error).splitlines()), type(error).__name__)


def numbers(column: Any) -> np.ndarray:
    """An Arrow array as (N,) float64 with NaN for null."""
    if hasattr(column.type, "tz"):  # dates: whole numbers of their unit
        column = column.cast("int64")
    return np.asarray(column.to_numpy(zero_copy_only=False), dtype=np.float64)


def _metadata(raw: dict[bytes, bytes]) -> dict[str, Any]:
    """What `write_table` stored, and other programs' entries as text."""
    found: dict[str, Any] = {}
    for key, value in raw.items():
        if key != METADATA_KEY and key != b"ARROW:schema":
            found[key.decode(errors="replace")] = value.decode(errors="replace")
    with suppress(ValueError):
        stored = json.loads(raw.get(METADATA_KEY, b"{}"))
        found.update(stored if isinstance(stored, dict) else {})
    return found


def column_names(table: Any) -> list[str]:
    """Columns of a Parquet file; none of one that cannot be read.

    Args:
        table: path of the file, or the file, opened.
    """
    import pyarrow.parquet as pq

    try:
        return pq.read_schema(table).names
    except damages():
        return []


def table_metadata(path: Path) -> dict[str, Any]:
    """What the writer of a table left; empty where the file cannot be read."""
    import pyarrow.parquet as pq

    try:
        return _metadata(pq.read_schema(path).metadata or {})
    except damages():
        return {}
