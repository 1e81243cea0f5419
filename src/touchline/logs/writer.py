# SPDX-License-Identifier: Apache-2.0
"""Writes Parquet tables so that a killed run leaves what it had finished readable.

Rows go to closed part files in `NAME.parts/`; at the end these become the one file `NAME.parquet`.
After a crash `pyarrow.parquet.read_table("NAME.parts")` reads what was finished; the part in
progress has a name with an underscore in front, which readers of data sets skip.
"""

import json
import os
import shutil
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Self

import numpy as np

from touchline.errors import InputError
from touchline.logs.parquet import METADATA_KEY
from touchline.model.description import AXES

# What a kill can cost. An hour at 1 kHz is one part, which need not be written a second time.
PART_ROWS = 1 << 22
PART_SECONDS = 30.0
_GROUP_ROWS = 1 << 16
_RESULTS = ("estimates", "contacts", "postures")
_DOCUMENTS = ("events.json", "analysis.json", "report.html")


def remove_results(directory: Path | str) -> None:
    """Remove the results of an earlier run, so that a new one is never mixed with it."""
    for name in _RESULTS:
        _remove_table(Path(directory) / f"{name}.parquet")
    for name in _DOCUMENTS:
        (Path(directory) / name).unlink(missing_ok=True)


def _remove_table(path: Path) -> None:
    path.unlink(missing_ok=True)
    _unfinished(path).unlink(missing_ok=True)
    shutil.rmtree(path.with_suffix(".parts"), ignore_errors=True)


def _unfinished(path: Path) -> Path:
    return path.with_name(f"_{path.name}")


class TableWriter:
    """A Parquet table that grows by blocks of columns. NaN and None become null.

    Used as a context manager it is closed at the end of the block; after an exception the parts
    stay, so that a table that is not complete never looks like one.
    """

    def __init__(
        self,
        path: Path | str,
        schema: Mapping[str, Any],
        metadata: Mapping[str, Any] | None = None,
        part_seconds: float | None = None,
    ):
        """Remove an old table at `path` and begin a new one.

        Args:
            path: of the Parquet file; its directory is made.
            schema: column name -> numpy dtype or "str".
            metadata: JSON values kept in the file, as `Log.metadata` returns them.
            part_seconds: after which a part is closed [s]: what a kill can cost.

        Raises:
            InputError: nothing can be written there.
        """
        import pyarrow as pa

        self.path = Path(path)
        self.parts = self.path.with_suffix(".parts")
        fields = [(name, _arrow_type(kind)) for name, kind in schema.items()]
        kept = {METADATA_KEY: json.dumps(dict(metadata))} if metadata else None
        self._schema = pa.schema(fields, metadata=kept)
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True)
            _remove_table(self.path)
        except OSError as error:
            raise InputError(f"{self.path}: cannot be written: {error.strerror}") from error
        self._count = 0  # closed parts
        self._part_seconds = PART_SECONDS if part_seconds is None else part_seconds
        self._rows = 0
        floats = [field.name for field in self._schema if pa.types.is_float64(field.type)]
        self._slots = {name: slot for slot, name in enumerate(floats)}
        # Rows that make no row group yet: in place for the next group too, as memory that is asked
        # for and given back over and over costs more than what is copied into it.
        self._numbers = np.empty((len(floats), 0))
        self._others: dict[str, list[Any]] = {
            name: [] for name in self._schema.names if name not in self._slots
        }
        self._waiting_rows = 0
        self._writer: Any = None
        self._part_rows, self._part_began = 0, 0.0

    @property
    def rows(self) -> int:
        """Rows written so far."""
        return self._rows

    def _part(self, number: int, done: bool) -> str:
        # No `Path`: Python would keep the name of each part, and its table of names would grow.
        return f"{self.parts}{os.sep}{'' if done else '_'}part-{number:05d}.parquet"

    def write(self, columns: Mapping[str, Any]) -> None:
        """Append rows.

        Args:
            columns: one array of equal length for every column of the schema.

        Raises:
            ValueError: columns are missing, unknown or of different lengths.
        """
        names = self._schema.names
        if set(columns) != set(names):
            odd = sorted(set(columns) ^ set(names))
            raise ValueError(f"{self.path}: missing or unknown columns: {', '.join(odd)}")
        numbers = [np.asarray(columns[name], np.float64) for name in self._slots]
        others = {
            name: _arrow_array(columns[name], self._schema.field(name).type)
            for name in self._others
        }
        lengths = {len(values) if values.ndim == 1 else -1 for values in numbers}
        lengths |= {len(values) for values in others.values()}
        if len(lengths) != 1 or -1 in lengths:
            raise ValueError(f"{self.path}: columns of different lengths or shapes")
        if rows := lengths.pop():
            self._append(numbers, others, rows)

    def _append(self, numbers: Sequence[np.ndarray], others: Mapping[str, Any], rows: int) -> None:
        if not self._part_rows:
            self._part_began = time.monotonic()
        self._part_rows += rows
        self._rows += rows
        first = 0
        while first < rows:
            begin = self._waiting_rows
            end = min(begin + rows - first, _GROUP_ROWS)
            self._make_room(end)
            last = first + end - begin
            for slot, values in enumerate(numbers):
                self._numbers[slot, begin:end] = values[first:last]
            for name, values in others.items():
                self._others[name].append(values[first:last])
            self._waiting_rows, first = end, last
            if end == _GROUP_ROWS:
                self._write_group()
        if (
            self._part_rows >= PART_ROWS
            or time.monotonic() - self._part_began >= self._part_seconds
        ):
            self._close_part()

    def _make_room(self, rows: int) -> None:
        """Room for so many rows; a short table never takes the room of a whole group."""
        held = self._numbers
        if rows > held.shape[1]:
            room = min(max(rows, 2 * held.shape[1]), _GROUP_ROWS)
            self._numbers = np.empty((len(held), room))
            self._numbers[:, : held.shape[1]] = held

    def _write_group(self) -> None:
        """Write what waits."""
        import pyarrow as pa

        if self._writer is None:
            self.parts.mkdir(exist_ok=True)
            self._writer = _parquet_writer(self._part(self._count, False), self._schema)
        numbers = self._numbers[:, : self._waiting_rows]
        # Where a sum finds no NaN, arrow need not look at each number.
        whole = ~np.isnan(numbers.sum(axis=1))
        arrays = [
            pa.chunked_array(self._others[name])
            if (slot := self._slots.get(name)) is None
            else pa.array(numbers[slot], from_pandas=not whole[slot])
            for name in self._schema.names
        ]
        table = pa.Table.from_arrays(arrays, schema=self._schema).combine_chunks()
        self._writer.write_table(table, row_group_size=_GROUP_ROWS)
        for held in self._others.values():
            held.clear()
        self._waiting_rows = 0

    def _close_part(self) -> None:
        if not self._part_rows:
            return
        if self._waiting_rows:
            self._write_group()
        self._writer.close()
        self._writer, self._part_rows = None, 0
        os.rename(self._part(self._count, False), self._part(self._count, True))
        self._count += 1

    def close(self) -> None:
        """Turn the parts into the table."""
        self._close_part()
        if self._count == 1:
            os.rename(self._part(0, True), self.path)
        else:
            self._merge()
        shutil.rmtree(self.parts, ignore_errors=True)

    def _merge(self) -> None:
        import pyarrow as pa

        with _parquet_writer(_unfinished(self.path), self._schema) as writer:
            held: list[Any] = []
            for group in self._groups():
                held.append(group)
                rows = sum(table.num_rows for table in held)
                if rows >= _GROUP_ROWS:
                    table = pa.concat_tables(held).combine_chunks()
                    whole = rows // _GROUP_ROWS * _GROUP_ROWS
                    writer.write_table(table.slice(0, whole), row_group_size=_GROUP_ROWS)
                    held = [table.slice(whole)]
            rest = pa.concat_tables(held).combine_chunks() if held else None
            if rest is not None and rest.num_rows:
                writer.write_table(rest, row_group_size=_GROUP_ROWS)
        _unfinished(self.path).rename(self.path)

    def _groups(self) -> Iterator[Any]:
        """The row groups of all parts."""
        import pyarrow.parquet as pq

        for number in range(self._count):
            with pq.ParquetFile(self._part(number, True), pre_buffer=False) as part:
                for group in range(part.num_row_groups):
                    yield part.read_row_group(group)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        if kind is None:
            self.close()
        else:
            self._close_part()


def _arrow_type(kind: Any) -> Any:
    import pyarrow as pa

    return pa.string() if kind in ("str", str) else pa.from_numpy_dtype(np.dtype(kind))


def _arrow_array(values: Any, kind: Any) -> Any:
    """NaN and None become null."""
    import pyarrow as pa

    return pa.array(values, type=kind, from_pandas=True)


def _parquet_writer(path: Path | str, schema: Any) -> Any:
    """Measured signals do not repeat: dictionaries and compression only cost time; words do.

    Of the largest and smallest values, which take time too, only those of stamps are read.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    words: Any = [field.name for field in schema if pa.types.is_string(field.type)] or False
    compression: Any = {
        field.name: "none" if pa.types.is_floating(field.type) else "lz4" for field in schema
    }
    stamps: Any = [name for name in ("time",) if name in schema.names] or False
    return pq.ParquetWriter(
        path,
        schema,
        compression=compression,
        use_dictionary=words,
        write_statistics=stamps,
        write_page_checksum=True,
    )


def mend_table(path: Path) -> bool:
    """Make the one file of a table whose writer was killed; True where there was one to mend.

    The parts stay: the next writer of this table removes them.
    """
    import pyarrow.parquet as pq

    parts = sorted(path.with_suffix(".parts").glob("part-*.parquet"))
    if path.exists() or not parts:
        return False
    with _parquet_writer(_unfinished(path), pq.read_schema(parts[0])) as writer:
        for part in parts:
            writer.write_table(pq.read_table(part), row_group_size=_GROUP_ROWS)
    _unfinished(path).rename(path)
    return True


class EstimateWriter:
    """Writes `estimates.parquet` with the contract's columns into a directory."""

    def __init__(
        self,
        directory: Path | str,
        joints: Sequence[str],
        sensors: Sequence[str],
        segments: Sequence[str],
        extra: Mapping[str, Any] | None = None,
    ):
        """Begin a new file; an old one in the directory is removed.

        Args:
            directory: made if it is not there.
            joints: names for `tau_ext.JOINT`.
            sensors: names for `SENSOR.ext.fx` ...
            segments: names for `SEGMENT.seg.fx` ...
            extra: further columns, name -> numpy dtype or "str".
        """
        self._joints = [f"tau_ext.{name}" for name in joints]
        self._sensors = [f"{name}.ext.{axis}" for name in sensors for axis in AXES]
        self._segments = [f"{name}.seg.{axis}" for name in segments for axis in AXES]
        schema: dict[str, Any] = {"time": "f8", "health": "u4"}
        schema |= dict.fromkeys((*self._joints, *self._sensors, *self._segments), "f8")
        self.table = TableWriter(Path(directory) / "estimates.parquet", schema | dict(extra or {}))

    def write(
        self,
        time: np.ndarray,
        health: np.ndarray,
        tau_ext: np.ndarray,
        sensor_wrench: np.ndarray,
        segment_wrench: np.ndarray,
        **extra: Any,
    ) -> None:
        """Append N rows.

        Args:
            time: (N,) [s].
            health: (N,) bits.
            tau_ext: (N, n) [Nm].
            sensor_wrench: (N, k, 6), sensor frames.
            segment_wrench: (N, s, 6), world frame and origin.
            extra: (N,) for each extra column.
        """
        columns: dict[str, Any] = {"time": time, "health": health}
        for names, values in (
            (self._joints, tau_ext),
            (self._sensors, sensor_wrench),
            (self._segments, segment_wrench),
        ):
            table = np.reshape(values, (len(time), len(names)))
            columns |= {name: table[:, j] for j, name in enumerate(names)}
        self.table.write(columns | extra)

    def close(self) -> None:
        """Finish the file."""
        self.table.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: Any) -> None:
        self.table.__exit__(*error)
