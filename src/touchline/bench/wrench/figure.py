# SPDX-License-Identifier: Apache-2.0
"""Two figures of the wrench benchmark: all errors at a glance, and what they look like in time."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.wrench.log import Log
from touchline.bench.wrench.methods import Method
from touchline.bench.wrench.scores import DEFAULT, Outcome
from touchline.bench.wrench.stage import SET_OFF, Stage
from touchline.figure import COLORS, INK, PAGE, SHADES, new_figure, panel_label, save, styled

LOOKS = {  # colour and marker
    "segment": (COLORS["segment"], "o"),
    "paper": (COLORS["paper"], "s"),
    "classical": (COLORS["classical"], "^"),
    "joints": (SHADES[4], "v"),
    "idyn-in": (SHADES[3], "D"),
    "idyn-out": (SHADES[6], "+"),
    "idyn-exact": (COLORS["truth"], "x"),
}
BASE = 0  # the segment shown in time
SPAN = 0.12  # of the moment when the arm sets off [s]


def save_figures(
    folder: Path, outcomes: Sequence[Outcome], methods: Sequence[Method], stage: Stage
) -> None:
    """Writes wrench.pdf, .svg, .png and wrench_time.pdf, .svg, .png.

    Args:
        folder: that exists.
        outcomes: of all scenarios.
        methods: that were run.
        stage: on which they were.
    """
    shown = [method for method in methods if method.name in LOOKS]  # Pinocchio's is the paper's
    save(errors_figure(outcomes, shown), folder, "wrench")
    save(time_figure(stage, shown), folder, "wrench_time")


def errors_figure(outcomes: Sequence[Outcome], methods: Sequence[Method]) -> Any:
    """Force error of every method by segment, but for impacts and ideal sensors."""
    shown = [o for o in outcomes if not o.scenario.name.startswith(("impacts", "ideal"))]
    rows = np.arange(len(shown))
    with styled():
        figure = new_figure(PAGE, 0.9 + 0.17 * len(shown))
        panels = figure.subplots(1, len(shown[0].segments), sharey=True, sharex=True)
        for axes, segment in zip(panels, shown[0].segments, strict=True):
            for method in methods:
                colour, marker = LOOKS[method.name]
                values = [o.best(method.name).values[_key(o, segment)] for o in shown]
                filled = {} if marker in "+x" else {"markerfacecolor": "none"}
                axes.plot(
                    values, rows, marker, color=colour, markersize=4, label=method.name, **filled
                )
            axes.set_xscale("log")
            axes.set_xlabel("force error [N]")
            panel_label(axes, segment)
        panels[0].set_yticks(rows, [_label(o) for o in shown])
        panels[0].invert_yaxis()
        handles = panels[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=len(methods), columnspacing=1.2)
    return figure


def _key(outcome: Outcome, segment: str) -> tuple[str, str, str]:
    return "", segment, "force_rms" if outcome.scenario.touched else "force_p999"


def _label(outcome: Outcome) -> str:
    name = outcome.scenario.name.replace("rad/s2", "rad/s²")
    return f"{name} ({'RMS' if outcome.scenario.touched else '99.9 %'})"


def time_figure(stage: Stage, methods: Sequence[Method]) -> Any:
    """The force on the structure, all with the same bandwidth, in three situations.

    `idyn-out` and `paper` would lie on `segment`.
    """
    parts = (
        ("sets off at 20 rad/s²", stage.set_off(20.0), (SET_OFF - 0.02, SET_OFF + SPAN)),
        ("joint 5 disturbed", stage.disturbed(), (0.5, 2.5)),
        ("20 N on link4, then elsewhere", stage.three_pushes(), (0.5, 2.4)),
    )
    real = [m for m in methods if m.real and m.name not in ("paper", "joints", "idyn-out")]
    with styled():
        figure = new_figure(PAGE, 2.2)
        panels = figure.subplots(1, len(parts))
        for axes, (title, log, span) in zip(panels, parts, strict=True):
            _draw(axes, log, span, real)
            panel_label(axes, title)
        panels[0].set_ylabel("force on the structure [N]")
        handles = panels[0].get_legend_handles_labels()
        figure.legend(*handles, loc="outside lower center", ncols=len(real) + 1)
    return figure


def _draw(axes: Any, log: Log, span: tuple[float, float], methods: Sequence[Method]) -> None:
    rows = (log.time >= span[0]) & (log.time < span[1])
    true = np.linalg.norm(log.truth[rows, BASE, :3], axis=1)
    axes.plot(log.time[rows], true, color=INK, linewidth=0.8, label="truth")
    for method in reversed(methods):
        trial = next(trial for trial in method.trials(log) if trial.bandwidth == DEFAULT)
        force = np.linalg.norm(trial.wrench[rows, BASE, :3], axis=1)
        colour = LOOKS[method.name][0]
        axes.plot(log.time[rows], force, color=colour, linewidth=0.6, label=method.name)
    axes.set_xlabel("time [s]")
    axes.margins(x=0)
    axes.set_ylim(bottom=0)
