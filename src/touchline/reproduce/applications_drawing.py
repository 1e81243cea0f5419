# SPDX-License-Identifier: Apache-2.0
"""Drawings of the applications."""

from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.figure import (
    COLORS,
    PAGE,
    legend_above,
    new_figure,
    panel_label,
    styled,
    thin,
)
from touchline.reproduce.applications import Application, tool_moment
from touchline.reproduce.arm_view import ArmView
from touchline.reproduce.experiment import Drawing
from touchline.reproduce.replay import FORCE

NAMES = {
    "screw": ("(a) Screwing", "Elbow: force"),
    "teaching": ("(b) Teaching", "Hand: force"),
}
INSTANTS = {"screw": 2.5, "teaching": 2.6}  # of the pictures [s]


def drawings(parts: list[Application]) -> dict[str, Drawing]:
    """One row for each application."""
    with styled():
        figure = new_figure(PAGE, 3.9)
        grid = figure.add_gridspec(len(parts), 4, width_ratios=(1.0, 1.25, 1.25, 1.25))
        for row, part in enumerate(parts):
            _picture(figure.add_subplot(grid[row, 0]), part)
            panels = [figure.add_subplot(grid[row, column]) for column in (1, 2, 3)]
            _curves(panels, part, row == 0, row == len(parts) - 1)
        return {"applications": Drawing(figure, CAPTION)}


CAPTION = (
    "Left: the arm at one instant; grey: true forces, rings: where they act, dots: points located "
    "from the sensors. Right: norms of the forces on each segment, and of the moment about the "
    "tip of the tool; orange: the error of eq. (5), joint torques alone."
)


def _picture(axes: Any, part: Application) -> None:
    replay = part.replay
    row = int(np.argmin(np.abs(replay.time - INSTANTS[part.name])))
    q = replay.signals[1][row]
    view = ArmView(replay.robot)
    view.draw(axes, q)
    for segment, color in (("wrist", COLORS["classical"]), (part.other, COLORS["segment"])):
        force, point = replay.true_force(segment)[row], replay.true_point(segment)[row]
        view.force(axes, point, force, COLORS["truth"])
        view.ring(axes, point, COLORS["truth"])
        located = replay.located(segment)[row]
        if np.isfinite(located).all():
            view.point(axes, located, color)
    view.frame(axes, q[None])
    axes.set_title(NAMES[part.name][0], loc="left", fontweight="bold", pad=9)
    axes.set_anchor("W")


def _curves(panels: list[Any], part: Application, first: bool, last: bool) -> None:
    replay = part.replay
    truth = {s: replay.filtered_truth(s) for s in ("wrist", part.other)}
    tool, other = replay.wrench("wrist"), replay.wrench(part.other)
    error = part.single - truth["wrist"]
    _norms(panels[0], replay.time, truth["wrist"][:, FORCE], tool[:, FORCE], error[:, FORCE])
    moments = (tool_moment(part, w) for w in (truth["wrist"], tool, error))
    _norms(panels[1], replay.time, *moments)
    _norms(panels[2], replay.time, truth[part.other][:, FORCE], other[:, FORCE], None)
    titles = ("Tool: force", "Tool: moment", NAMES[part.name][1])
    for panel, title, unit in zip(panels, titles, ("N", "Nm", "N"), strict=True):
        panel_label(panel, title)
        panel.set_ylabel(unit, labelpad=1)
        panel.set_xlim(replay.time[0], replay.time[-1])
        panel.set_ylim(bottom=0)
        if last:
            panel.set_xlabel("time [s]")
    if first:
        legend_above(panels[2], 2, panels[2].get_lines())
        legend_above(panels[1], 1, panels[1].get_lines()[-1:])


def _norms(axes: Any, time: Array, truth: Array, ours: Array, error: Array | None) -> None:
    time, truth, ours = thin(time, *(np.linalg.norm(x, axis=1) for x in (truth, ours)))
    axes.plot(time, truth, color=COLORS["truth"], lw=2.6, alpha=0.7, label="true")
    axes.plot(time, ours, color=COLORS["segment"], label="ours")
    if error is not None:
        norm = thin(np.linalg.norm(error, axis=1))[0]
        axes.plot(time, norm, color=COLORS["classical"], lw=0.8, label="error of eq. (5)", zorder=1)
