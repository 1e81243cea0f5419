# SPDX-License-Identifier: Apache-2.0
"""Small pieces of HTML."""

import re
from collections.abc import Iterable, Sequence
from html import escape
from typing import Any

import numpy as np

SHORT = 24  # characters of a cell that stay on one line


def text(value: Any) -> str:
    """A value as escaped text; numbers short, nothing for None and NaN."""
    if value is None or (isinstance(value, float) and np.isnan(value)):
        return ""
    if isinstance(value, float):
        return escape(f"{value:.6g}")
    if isinstance(value, tuple | list):
        return ", ".join(map(text, value))
    return escape(str(value))


def table(head: Sequence[str], rows: Iterable[Sequence[Any]], rows_as: Sequence[str] = ()) -> str:
    """A table; a number, or text that is one, stands on the right. Empty columns are left out.

    Args:
        head: the columns' names.
        rows: values, or finished cells as `Cell`.
        rows_as: attributes of each row.
    """
    rows = [list(row) for row in rows]
    kept = [i for i in range(len(head)) if not rows or any(text(row[i]) for row in rows)]
    head, rows = [head[i] for i in kept], [[row[i] for i in kept] for row in rows]
    numeric = [all(_is_number(row[i]) for row in rows) for i in range(len(head))]
    kinds = [
        _kind(is_number, [cell(row[i]) for row in rows]) for i, is_number in enumerate(numeric)
    ]
    # What scrolls takes the keyboard's focus, and needs a name; an empty header is none.
    named = escape(", ".join(name for name in head if name) or "facts")
    lines = [f'<div class="scroll" tabindex="0" role="group" aria-label="table: {named}">']
    lines.append("<table>")
    if any(head):
        tags = ["th" if name else "td" for name in head]
        names = "".join(
            f"<{tag}{kind}>{escape(name)}</{tag}>"
            for tag, name, kind in zip(tags, head, kinds, strict=True)
        )
        lines.append(f"<thead><tr>{names}</tr></thead>")
    lines.append("<tbody>")
    for i, row in enumerate(rows):
        cells = (f"<td{kind}>{cell(v)}</td>" for v, kind in zip(row, kinds, strict=True))
        lines.append(f"<tr{rows_as[i] if rows_as else ''}>{''.join(cells)}</tr>")
    return "".join([*lines, "</tbody></table></div>"])


class Cell(str):
    """HTML that stands as it is."""


def cell(value: Any) -> str:
    """The content of a table's cell."""
    return value if isinstance(value, Cell) else text(value)


def _kind(is_number: bool, cells: Sequence[str]) -> str:
    """How a column breaks: numbers and short words do not, sentences have room."""
    longest = max((len(re.sub("<[^>]*>", "", one)) for one in cells), default=0)
    if is_number:
        return ' class="number"'
    return ' class="tight"' if longest <= SHORT else ' class="words"'


def _is_number(value: Any) -> bool:
    if value is None or isinstance(value, int | float):
        return True
    try:
        float(str(value))
    except ValueError:
        return str(value) == ""
    return True


def section(title: str, *parts: str, anchor: str = "") -> str:
    """A section with a heading."""
    mark = f' id="{anchor}"' if anchor else ""
    return f"<section{mark}><h2>{escape(title)}</h2>{''.join(parts)}</section>"


def note(words: str) -> str:
    """A remark in small print."""
    return f'<p class="note">{escape(words)}</p>'
