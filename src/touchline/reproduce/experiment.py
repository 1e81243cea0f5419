# SPDX-License-Identifier: Apache-2.0
"""What an experiment hands back: words, figures, series, tables, and what must hold."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from touchline.arrays import Array

Tick = Callable[[str], None]  # called at the end of each step of the work, with its name
Row = Mapping[str, str | float | int | None]


@dataclass(frozen=True)
class Check:
    """A number that must stay below a limit for the experiment to count as reproduced.

    Attributes:
        name: what is measured, with its unit.
        value: measured.
        limit: `value` must be below it, or equal to it if it is 0.
    """

    name: str
    value: float
    limit: float

    @property
    def holds(self) -> bool:
        """Whether the value keeps to its limit; a NaN does not."""
        return self.value < self.limit or self.value == self.limit == 0


@dataclass(frozen=True)
class Table:
    """Rows of numbers with a caption; written as CSV under the table's name.

    Attributes:
        caption: what it shows.
        rows: one mapping per row, all with the same keys.
        shown: keys that the page shows; default: all.
    """

    caption: str
    rows: Sequence[Row]
    shown: Sequence[str] = ()


@dataclass(frozen=True)
class Drawing:
    """A figure and its caption."""

    figure: Any  # matplotlib's Figure, which is not imported before it is drawn
    caption: str


@dataclass(frozen=True)
class Experiment:
    """One experiment.

    Attributes:
        name: of its folder.
        title: heading.
        shown, paper, seen: a paragraph each: what is shown, what the paper says, what we see.
        drawings: by file name without ending.
        series: the plotted series by name, (N,) each, by file name without ending.
        tables: by file name without ending.
        checks: what must hold.
    """

    name: str
    title: str
    shown: str
    paper: str
    seen: str
    drawings: Mapping[str, Drawing] = field(default_factory=dict)
    series: Mapping[str, Mapping[str, Array]] = field(default_factory=dict)
    tables: Mapping[str, Table] = field(default_factory=dict)
    checks: Sequence[Check] = ()
