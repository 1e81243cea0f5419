# SPDX-License-Identifier: Apache-2.0
"""Two figures of the reaction benchmark: a clamping in time, and all peaks at a glance."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from touchline.figure import (
    FAINT,
    PAGE,
    SHADES,
    legend_above,
    new_figure,
    panel_label,
    save,
    styled,
)
from touchline.reaction.reaction import REACTIONS
from touchline.trials.reacting import (
    QUIET,
    SCENES,
    Case,
    Trial,
    encounter_of,
    outcome_of,
    pressing,
)

LOOKS = dict(zip(REACTIONS, (FAINT, *SHADES), strict=False))
MARKERS = dict(zip(REACTIONS, "os^v", strict=True))
SHOWN = (Case("wall", "link5", 0.5, 0), Case("free", "link5", 1.0, 0))
TICKS = (10, 30, 100, 300, 1000, 3000)  # N
SPAN = (-0.02, 0.4)  # s around the touch


def save_figures(folder: Path, trials: Sequence[Trial]) -> None:
    """Writes reaction_time and reaction, each as .pdf, .svg and .png, into a folder."""
    save(time_figure(), folder, "reaction_time")
    save(peak_figure(trials), folder, "reaction")


def time_figure() -> Any:
    """Force over time with every reaction, against a wall and against a body that gives way."""
    with styled():
        figure = new_figure(PAGE, 2.2)
        for axes, case in zip(figure.subplots(1, len(SHOWN)), SHOWN, strict=True):
            encounter = encounter_of(case)
            for name in REACTIONS:
                outcome = outcome_of(case, encounter, name)
                force = pressing(outcome)
                time = outcome.readings.time - outcome.readings.time[np.argmax(force > 0)]
                inside = (time > SPAN[0]) & (time < (SPAN[1] if case.scene == "wall" else 0.1))
                axes.plot(1e3 * time[inside], force[inside], color=LOOKS[name], label=name)
            axes.axhline(QUIET, color=FAINT, linewidth=0.6, linestyle=":")
            axes.set_xlabel("time from the touch [ms]")
            axes.set_ylabel("force [N]")
            panel_label(axes, f"{case.scene}, {case.link}, {case.speed:g} m/s")
        legend_above(axes, len(REACTIONS))
    return figure


def peak_figure(trials: Sequence[Trial]) -> Any:
    """Peak force with a reaction against that without, one mark for each encounter."""
    without = {(t.scene, t.link, t.speed, t.seed): t.peak for t in trials if t.reaction == "ignore"}
    with styled():
        figure = new_figure(PAGE, 2.5)
        panels = figure.subplots(1, len(SCENES), sharex=True, sharey=True)
        for axes, scene in zip(panels, SCENES, strict=True):
            most = max(without.values())
            axes.plot([1, most], [1, most], color=FAINT, linewidth=0.6)
            for name in list(REACTIONS)[1:]:
                chosen = [t for t in trials if t.scene == scene and t.reaction == name]
                before = [without[t.scene, t.link, t.speed, t.seed] for t in chosen]
                after = [t.peak for t in chosen]
                look = {"markerfacecolor": "none", "markersize": 3.5, "markeredgewidth": 0.8}
                axes.plot(before, after, MARKERS[name], color=LOOKS[name], label=name, **look)
            axes.set_xscale("log")
            axes.set_yscale("log")
            for axis in (axes.xaxis, axes.yaxis):
                axis.set_ticks(TICKS, [f"{force:g}" for force in TICKS])
                axis.set_ticks([], minor=True)
            axes.set_xlim(0.8 * np.min(list(without.values())), 1.2 * most)
            axes.set_ylim(0.8 * np.min([t.peak for t in trials]), 1.2 * most)
            axes.set_xlabel("peak without reaction [N]")
            panel_label(axes, scene)
        panels[0].set_ylabel("peak with reaction [N]")
        legend_above(panels[-1], len(REACTIONS) - 1)
    return figure
