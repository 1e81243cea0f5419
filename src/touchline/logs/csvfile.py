# SPDX-License-Identifier: Apache-2.0
"""Reads a table from CSV or gzipped CSV in bounded memory, as far as the file is whole."""

import csv
import io
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.logs.blocks import Block, block_rows, take
from touchline.logs.columns import Selection, select_columns
from touchline.logs.lines import WholeLines
from touchline.logs.naming import Naming
from touchline.logs.parquet import numbers
from touchline.logs.source import HEAD_ROWS
from touchline.model.description import RobotDescription

# A block of text is parsed at once; the streaming reader holds a few of them.
_BLOCK_BYTES = 4 << 20
_DELIMITERS = (",", ";", "\t")
_NULLS = ("", "nan", "NaN", "NAN", "-nan", "null", "NULL", "None", "NA", "N/A")


def _header(path: Path) -> tuple[list[str], str]:
    """Column names and the delimiter, from the first line."""
    with WholeLines(path) as stream:
        try:
            line = io.BufferedReader(stream).readline().decode("utf-8-sig").strip()
        except UnicodeDecodeError as error:
            raise InputError(f"{path}: not a text file in UTF-8 ({error.reason})") from error
        if not line:
            damage = f" ({stream.damage})" if stream.damage else ""
            raise InputError(f"{path}: the file is empty{damage}")
    delimiter = max(_DELIMITERS, key=line.count)
    names = [name.strip() for name in next(csv.reader([line], delimiter=delimiter))]
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line holds numbers, not column names: {line[:80]!r}")
    return names, delimiter


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


class CsvSource:
    """A CSV file as a log."""

    def __init__(self, path: Path, description: RobotDescription, naming: Naming):
        """Read the header and find the columns.

        Raises:
            InputError: the file is empty, has no header, or columns are missing.
        """
        self.path = path
        names, self._delimiter = _header(path)
        self.columns = tuple(names)
        self._selection: Selection = select_columns(description, naming, names, str(path))
        self.without_velocity = self._selection.without_velocity
        self.rows = self.duration = None
        self.topics: dict[str, str] = {}
        self.metadata: dict[str, Any] = {}
        self.warnings: list[str] = []
        self.delayed_wrenches = True
        self._stream: WholeLines | None = None

    def head(self) -> Block:
        """The first rows."""
        empty = self._selection.assemble(lambda _: np.empty(0), 0)
        blocks = self._blocks(quiet=True)
        found = next(blocks, empty)
        blocks.close()
        self.close()
        self._stream = None
        return take(found, 0, HEAD_ROWS)

    def blocks(self) -> Iterator[Block]:
        """All rows; the rows after a cut are missing, with a warning.

        Raises:
            InputError: a cell is no number, or a row has too few or too many cells.
        """
        yield from self._blocks(quiet=False)

    def _blocks(self, quiet: bool) -> Generator[Block, None, None]:
        import pyarrow as pa

        self.close()
        stream = WholeLines(self.path, self._delimiter.encode(), len(self.columns))
        self._stream = stream
        rows = 0
        try:
            for batch in self._batches(stream):
                block = self._selection.assemble(
                    lambda name, batch=batch: numbers(batch.column(name)), batch.num_rows
                )
                rows += block_rows(block)
                yield block
        except pa.ArrowInvalid as error:
            raise InputError(self._diagnose() or f"{self.path}: {error}") from error
        if not rows:
            damage = f" ({stream.damage})" if stream.damage else ""
            raise InputError(f"{self.path}: no rows below the header{damage}")
        if not quiet:
            self._report_cut(stream, rows)

    def _batches(self, stream: WholeLines) -> Iterator[Any]:
        import pyarrow as pa
        import pyarrow.csv as arrow_csv

        wanted = self._selection.names
        # Columns that are not wanted may have any names, even the same one twice.
        unique = [n if n in wanted else f"{i}\0{n}" for i, n in enumerate(self.columns)]
        stream.readline()
        reader = self._open(arrow_csv, pa, stream, unique)
        if reader is None:
            return
        with reader:
            yield from reader

    def _open(self, arrow_csv: Any, pa: Any, stream: WholeLines, unique: list[str]) -> Any:
        wanted = self._selection.names
        try:
            return arrow_csv.open_csv(
                stream,
                read_options=arrow_csv.ReadOptions(column_names=unique, block_size=_BLOCK_BYTES),
                parse_options=arrow_csv.ParseOptions(delimiter=self._delimiter),
                convert_options=arrow_csv.ConvertOptions(
                    include_columns=wanted,
                    column_types=dict.fromkeys(wanted, pa.float64()),
                    null_values=list(_NULLS),
                ),
            )
        except pa.ArrowInvalid as error:
            if "Empty CSV" in str(error):
                return None
            raise

    def _report_cut(self, stream: WholeLines, rows: int) -> None:
        if stream.damage:
            self.warnings.append(
                f"{self.path}: the file is cut off or damaged after row {rows} ({stream.damage}); "
                "the rows before are used"
            )
        elif stream.partial:
            self.warnings.append(
                f"{self.path}: the last line (after row {rows}) is incomplete and is left out"
            )

    def _diagnose(self) -> str | None:
        """Find the first bad cell or row by reading the text again, slowly."""
        wanted = [(self.columns.index(name), name) for name in self._selection.names]
        with WholeLines(self.path, self._delimiter.encode(), len(self.columns)) as stream:
            text = io.TextIOWrapper(io.BufferedReader(stream), encoding="utf-8", errors="replace")
            reader = csv.reader(text, delimiter=self._delimiter)
            next(reader, None)
            row = 0
            for cells in reader:
                if not cells:
                    continue
                where = f"{self.path}: row {row} (line {reader.line_num})"
                if len(cells) != len(self.columns):
                    return f"{where} has {len(cells)} cells; the header has {len(self.columns)}"
                for at, name in wanted:
                    cell = cells[at].strip()
                    if cell not in _NULLS and not _is_number(cell):
                        return f"{where}, column {name!r}: {cells[at]!r} is not a number"
                row += 1
        return None

    def progress(self) -> float:
        """Fraction of the file's bytes read."""
        return self._stream.fraction if self._stream else 0.0

    def close(self) -> None:
        """Release the file."""
        if self._stream is not None and not self._stream.closed:
            self._stream.close()
