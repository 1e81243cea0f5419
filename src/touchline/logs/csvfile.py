# SPDX-License-Identifier: Apache-2.0
"""Reads a table from CSV or gzipped CSV in bounded memory, as far as the file is whole."""

import csv
import io
from collections.abc import Generator, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from touchline import _logs
from touchline.errors import InputError
from touchline.logs.blocks import Block, take
from touchline.logs.clock import in_seconds
from touchline.logs.columns import Selection, select_columns
from touchline.logs.lines import WholeLines
from touchline.logs.naming import Naming
from touchline.logs.source import HEAD_ROWS
from touchline.model.description import RobotDescription

_BLOCK_BYTES = 1 << 20  # of text that is read at once
_DELIMITERS = (",", ";", "\t")


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
        self.losses = self.warnings  # there is nothing else to warn of
        self.delayed_wrenches = True
        self._stream: WholeLines | None = None
        naming = in_seconds(naming, path, self.warnings, lambda: self.head()["time"], None)
        self._selection = select_columns(description, naming, names, str(path))

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
        self.close()
        stream = WholeLines(self.path, self._delimiter.encode(), len(self.columns))
        self._stream = stream
        stream.readline()
        columns = sorted(self.columns.index(name) for name in self._selection.names)
        place = {self.columns[column]: i for i, column in enumerate(columns)}
        rows, lines = 0, 1
        while text := stream.read(_BLOCK_BYTES):
            values, read, problem = _logs.read_csv(
                text, self._delimiter, len(self.columns), columns
            )
            rows += len(values)
            if len(values):
                yield self._selection.assemble(
                    lambda name, values=values: values[:, place[name]], len(values)
                )
            if problem is not None:
                raise InputError(self._told(rows, lines, problem))
            lines += read
        if not rows:
            damage = f" ({stream.damage})" if stream.damage else ""
            raise InputError(f"{self.path}: no rows below the header{damage}")
        if not quiet:
            self._report_cut(stream, rows)

    def _told(self, row: int, lines: int, problem: tuple[int, int, int, bytes]) -> str:
        line, cells, column, cell = problem
        where = f"{self.path}: row {row} (line {lines + line + 1})"
        if cells:
            return f"{where} has {cells} cells; the header has {len(self.columns)}"
        text = cell.decode("utf-8", errors="replace")[:80]
        return f"{where}, column {self.columns[column]!r}: {text!r} is not a number"

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

    def progress(self) -> float:
        """Fraction of the file's bytes read."""
        return self._stream.fraction if self._stream else 0.0

    def close(self) -> None:
        """Release the file."""
        if self._stream is not None and not self._stream.closed:
            self._stream.close()


def read_head(path: Path, rows: int) -> tuple[list[str], list[list[str]]]:
    """Column names and the cells of the first rows, as they stand.

    Raises:
        InputError: the file is empty, is no text, or has no header.
    """
    names, delimiter = _header(path)
    with WholeLines(path) as stream:
        text = io.TextIOWrapper(io.BufferedReader(stream), "utf-8-sig", errors="replace")
        lines = [line for _, line in zip(range(rows + 1), text, strict=False)]
    return names, list(csv.reader(lines[1:], delimiter=delimiter))
