# SPDX-License-Identifier: Apache-2.0
"""Stamps that are not seconds: whole nanoseconds, as ROS and pandas keep them, and dates."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.logs.naming import Naming

FASTEST = 1e5  # ns: no robot's log has more than 10,000 samples a second, nor one in a day
UNITS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}  # of dates in Arrow


def in_seconds(
    naming: Naming, path: Path, warnings: list[str], head: Callable[[], Array], unit: str | None
) -> Naming:
    """The naming with a factor that makes seconds of the stamps, where `log` gives none.

    Stamps that are nanoseconds are told: a median step that could be seconds only in a recording
    with less than one sample a day.

    Args:
        naming: of the description.
        path: of the log, for what is told.
        warnings: where it is told.
        head: gives the first stamps, in seconds if `naming` is right.
        unit: "s", "ms", "us" or "ns" of a column of dates; None for one of numbers.
    """
    column = naming.time
    if unit is not None:
        return replace(naming, time=replace(column, factor=UNITS[unit]))
    if column.factor != 1.0:
        return naming
    steps = np.diff(head())
    steps = steps[steps > 0.0]
    if not len(steps) or np.median(steps) < FASTEST:
        return naming
    step = float(np.median(steps)) * 1e-6
    warnings.append(
        f"{path}: column {column.name!r} is taken as nanoseconds: the median step is {step:.4g} ms"
    )
    return replace(naming, time=replace(column, factor=UNITS["ns"]))
