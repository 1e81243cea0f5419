# SPDX-License-Identifier: Apache-2.0
"""Drawing of figure 6."""

from typing import Any

import numpy as np

from touchline.figure import (
    COLORS,
    FAINT,
    PAGE,
    legend_above,
    new_figure,
    panel_label,
    styled,
)
from touchline.reproduce.arm_view import ArmView
from touchline.reproduce.experiment import Drawing, Row
from touchline.reproduce.fig6 import LINKS, NEAR, RIGHT, Case
from touchline.reproduce.wrench_routes import METHODS, NAMES

TONES = {"eq5": "#b9bec4", "classical": COLORS["classical"], "ours": COLORS["segment"]}
WIDTH = 0.26


def drawings(cases: list[Case], table: list[Row]) -> dict[str, Drawing]:
    """The cases over the fractions."""
    with styled():
        figure = new_figure(PAGE, 3.7)
        upper, lower = figure.subfigures(2, 1, height_ratios=(1.25, 1.0))
        for axes, case in zip(upper.subplots(1, len(cases)), cases, strict=True):
            _picture(axes, case)
        _bars(lower.subplots(), table)
        return {"fig6": Drawing(figure, CAPTION)}


CAPTION = (
    "Above: the cases; grey arrows: true forces, rings: true points, blue dots: points located "
    "from the sensors. Below: fraction of random pushes whose force is right within "
    f"{RIGHT:g} N and whose point within {100 * NEAR:g} cm; eq. (5) is told the link."
)


def _picture(axes: Any, case: Case) -> None:
    replay, row = case.replay, case.row
    q, truth = replay.signals[1][row], replay.simulated.truth
    view = ArmView(replay.robot, azimuth=-0.5, elevation=0.3)
    view.draw(axes, q)
    for slot in np.flatnonzero(truth.link[row] >= 0):
        point = truth.point[row, slot]
        view.force(axes, point, 1.6 * truth.force[row, slot], FAINT)
        view.ring(axes, point, FAINT, 8)
    for segment in replay.robot.segment_names:
        located = replay.located(segment)[row]
        if np.isfinite(located).all():
            view.point(axes, located, COLORS["segment"], 4.5)
    view.frame(axes, q[None], 0.12)
    axes.set_title(case.name, pad=2)


def _bars(axes: Any, table: list[Row]) -> None:
    for i, method in enumerate(METHODS):
        heights = [
            100 * float(row["both_right"] or 0.0) for row in table if row["method"] == method
        ]
        x = np.arange(len(LINKS)) + WIDTH * (i - 1)
        bars = axes.bar(x, heights, 0.9 * WIDTH, color=TONES[method], label=NAMES[method])
        axes.bar_label(bars, fmt="%.0f", fontsize=5.5, padding=1)
    axes.set_xticks(np.arange(len(LINKS)), LINKS)
    axes.grid(axis="x", visible=False)
    axes.tick_params(axis="x", length=0)
    axes.set_ylim(0, 112)
    axes.set_yticks([0, 50, 100])
    axes.set_ylabel("right [%]")
    panel_label(axes, "Random pushes, by link")
    legend_above(axes, len(METHODS))
