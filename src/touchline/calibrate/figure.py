# SPDX-License-Identifier: Apache-2.0
"""A figure of a calibration: how often which statistic was exceeded, and the thresholds."""

from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.calibrate.run import Calibration, Thresholds
from touchline.detector.calibration import Statistics
from touchline.detector.tail import Tail, alarm_levels
from touchline.errors import InputError
from touchline.figure import FAINT, INK, SHADES, new_figure, panel_label, rendered, styled
from touchline.folder import check_file
from touchline.model.values import METHODS

ENDINGS = ".svg", ".png", ".pdf"
LEFT_OUT = 0.3  # of the tail's range, below its beginning, that is shown as well


def check_figure(path: Path) -> None:
    """Sees that a figure can be drawn, before the work.

    Raises:
        InputError: the ending is none of `ENDINGS`, or it cannot be written.
        ModuleNotFoundError: matplotlib is missing.
    """
    from importlib import import_module

    if path.suffix not in ENDINGS:
        raise InputError(f"--figure {path}: allowed endings: {', '.join(ENDINGS)}")
    import_module("matplotlib")
    check_file(path, "--figure")


def draw_calibration(result: Calibration, path: Path) -> None:
    """Draws one panel for each segment and method.

    Steps: alarms an hour against the threshold, on the data held out and on the others. Line: the
    tail that was fitted to all of them. Dashed: the threshold for the rate that is asked for, with
    its 95 % interval.

    Raises:
        InputError: the file cannot be written.
    """
    thresholds = result.thresholds
    if thresholds is None:
        raise InputError(f"--figure {path}: there are no thresholds to draw")
    names = [name for name in result.robot.segment_names if name in thresholds.tails]
    figure = new_figure(2.3 * len(METHODS), 2.1 * len(names))
    with styled():
        _fill(figure, result, thresholds, names)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(rendered(figure, path.suffix[1:]))
    except OSError as error:
        raise InputError(f"--figure {path}: cannot be written: {error.strerror}") from None


def _fill(figure: Any, result: Calibration, thresholds: Thresholds, names: list[str]) -> None:
    grid = figure.subplots(len(names), len(METHODS), squeeze=False)
    for line, name in zip(grid, names, strict=True):
        for t, (axes, method) in enumerate(zip(line, METHODS, strict=True)):
            tail = thresholds.tails[name].get(method)
            if tail is None:
                axes.axis("off")
                continue
            g = result.robot.segment_names.index(name)
            _panel(axes, result.share, thresholds, tail, (g, t))
            used = method in result.robot.description.detection.method
            panel_label(axes, f"{name}: {method}{' (in use)' if used else ''}")
    drawn = [axes for axes in grid.flat if axes.lines]
    drawn[0].legend()
    for axes in grid[:, 0]:
        axes.set_ylabel("alarms an hour")
    for axes in grid[-1]:
        axes.set_xlabel("threshold")


def _panel(
    axes: Any, share: float, thresholds: Thresholds, tail: Tail, at: tuple[int, int]
) -> None:
    limit, (low, high) = tail.threshold(share), tail.interval(share)
    most = 1.15 * max(limit, tail.level)
    for part, colour, label in (
        (thresholds.train, SHADES[0], "the others"),
        (thresholds.test, SHADES[1], "held out"),
    ):
        levels, rates = _seen(part, at)
        axes.step(levels, rates, where="pre", color=colour, label=label)
        most = max(most, 1.02 * float(levels.max(initial=0.0)))
    least = tail.level - LEFT_OUT * (most - tail.level)
    x = np.linspace(tail.level, most, 200)
    axes.plot(x, tail.rate(x), color=INK, lw=0.8, label="tail, of all")
    axes.axvline(limit, color=INK, lw=0.8, ls="--")
    axes.axvspan(low, high, color=INK, alpha=0.08, lw=0)
    axes.axhline(share, color=FAINT, lw=0.6, ls=":")
    axes.set_yscale("log")
    axes.set_xlim(max(least, 0.0), most)
    axes.set_ylim(0.2 * min(share, 1.0 / tail.hours), 2.0 * tail.per_hour)


def _seen(found: Statistics, at: tuple[int, int]) -> tuple[Array, Array]:
    """Thresholds and the alarms an hour that they give."""
    levels = alarm_levels(found.blocks[:, at[0], at[1]], found.gap)
    return levels, np.arange(1, len(levels) + 1) / found.hours
