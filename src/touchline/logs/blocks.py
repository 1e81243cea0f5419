# SPDX-License-Identifier: Apache-2.0
"""Blocks of consecutive log rows, and windows over them that do not show where blocks ended.

A block maps signal names to arrays that all have one row per log row.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np

Block = dict[str, np.ndarray]


def block_rows(block: Block) -> int:
    """Number of log rows in a block."""
    return len(next(iter(block.values())))


def take(block: Block, start: int, stop: int) -> Block:
    """Rows start..stop as views."""
    return {name: values[start:stop] for name, values in block.items()}


def join(blocks: list[Block]) -> Block:
    """The rows of all blocks, one after another."""
    if len(blocks) == 1:
        return blocks[0]
    return {name: np.concatenate([block[name] for block in blocks]) for name in blocks[0]}


@dataclass(frozen=True)
class Window:
    """Rows with their neighbours.

    Attributes:
        padded: the rows and up to `halo` rows before and after them; fewer only where the log ends.
        start: index in `padded` of the first row proper.
        stop: index after the last row proper.
        row: number of the first row proper in the log.
    """

    padded: Block
    start: int
    stop: int
    row: int


def windows(blocks: Iterable[Block], rows: int, halo: int) -> Iterator[Window]:
    """Cut a stream of blocks into windows of exactly `rows` rows (the last may be shorter).

    Whatever is computed for a row from at most `halo` rows on either side of it is therefore the
    same for every `rows` and for every way in which the log came in blocks.
    """
    parts: list[Block] = []
    held = start = row = 0  # rows in `parts`; where the next window begins in them, and in the log
    for block in blocks:
        if not block_rows(block):
            continue
        parts.append(block)
        held += block_rows(block)
        if held < start + rows + halo:
            continue
        buffer = join(parts)
        while held - start >= rows + halo:
            low, stop = max(start - halo, 0), start + rows
            yield Window(take(buffer, low, stop + halo), start - low, stop - low, row)
            start, row = stop, row + rows
        drop = max(start - halo, 0)
        parts, held, start = [take(buffer, drop, held)], held - drop, start - drop
    yield from _last_windows(parts, held, start, row, rows, halo)


def _last_windows(
    parts: list[Block], held: int, start: int, row: int, rows: int, halo: int
) -> Iterator[Window]:
    if not parts:
        return
    buffer = join(parts)
    while start < held:
        low, stop = max(start - halo, 0), min(start + rows, held)
        padded = take(buffer, low, min(stop + halo, held))
        yield Window(padded, start - low, stop - low, row)
        start, row = stop, row + stop - start
