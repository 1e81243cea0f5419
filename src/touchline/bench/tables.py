# SPDX-License-Identifier: Apache-2.0
"""Tables for reading."""

from collections.abc import Sequence

Row = tuple[str, ...]


def aligned(rows: Sequence[Row], text_columns: tuple[int, ...] = (0,)) -> str:
    """Columns of equal width: text to the left, numbers to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        cells = [
            cell.ljust(width) if i in text_columns else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append("  ".join(cells).rstrip())
    return "\n".join(lines)
