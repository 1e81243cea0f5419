# SPDX-License-Identifier: Apache-2.0
"""Figures of the detection benchmark: share found within the goal against false alarms."""

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from touchline.bench.detection import Outcome

COLOURS = {
    "rows": "#7f7f7f",
    "scaled": "#bcbd22",
    "chi2": "#1f77b4",
    "glrt": "#d62728",
    "cusum": "#2ca02c",
    "lowpass": "#9467bd",
}


def draw(
    outcomes: list["Outcome"],
    rates: np.ndarray,
    goals: dict[tuple[float, float], tuple[float, float]],
    names: dict[str, str],
    out: Path,
) -> None:
    """Writes roc.svg and delay.svg.

    Args:
        outcomes: of all settings.
        rates: false alarms per hour that thresholds are set for.
        goals: (sample rate, velocity noise) -> force and time.
        names: of the layouts.
        out: folder.
    """

    def roc(axes: Any, o: "Outcome") -> None:
        force, limit = goals[o.setting.rate, o.setting.velocity]
        for method in o.methods:
            found = [np.mean(o.delays(method, force, r) <= limit) for r in rates]
            axes.semilogx(rates, 100 * np.array(found), color=COLOURS[method], label=method)
        axes.axhline(95, color="k", lw=0.5, ls=":")
        axes.set_ylim(0, 103)
        axes.set_xlabel("false alarms per hour, as set")
        axes.set_ylabel(f"% of {force:g} N found within {1e3 * limit:g} ms")

    def delay(axes: Any, o: "Outcome") -> None:
        forces = sorted(o.pushes)
        for method in o.methods:
            median = [1e3 * np.median(o.delays(method, f, 1.0)) for f in forces]
            axes.loglog(forces, median, "o-", ms=3, color=COLOURS[method], label=method)
        axes.set_xticks(forces, [f"{force:g}" for force in forces])
        axes.set_xticks([], minor=True)
        axes.set_xlabel("force [N]")
        axes.set_ylabel("median delay at 1 per hour [ms]")

    _sheet(outcomes, names, roc, out / "roc.svg")
    _sheet(outcomes, names, delay, out / "delay.svg")


def _sheet(
    outcomes: list["Outcome"],
    names: dict[str, str],
    panel: Callable[[Any, "Outcome"], None],
    path: Path,
) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.rcParams["svg.hashsalt"] = "touchline"
    columns = min(4, len(outcomes))
    lines = -(-len(outcomes) // columns)
    figure = Figure(figsize=(3.6 * columns, 3.1 * lines), layout="constrained")
    grid = figure.subplots(lines, columns, squeeze=False)
    for axes in grid.flat[len(outcomes) :]:
        axes.axis("off")
    for axes, o in zip(grid.flat, outcomes, strict=False):
        panel(axes, o)
        s = o.setting
        axes.set_title(
            f"{names[s.layout]}, {s.rate / 1000:g} kHz, {s.velocity:g} rad/s", fontsize=9
        )
        axes.grid(alpha=0.3)
    grid.flat[0].legend(fontsize=8)
    figure.savefig(path, metadata={"Date": None})
