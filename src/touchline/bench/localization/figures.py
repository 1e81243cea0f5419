# SPDX-License-Identifier: Apache-2.0
"""Figures of the localization benchmark: arms coloured by error, and how errors are distributed."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.bench.localization.baselines import BASELINES
from touchline.bench.localization.surface_map import SurfaceMap, framing
from touchline.bench.localization.touched import NEAR
from touchline.bench.localization.trial import Trial
from touchline.figure import FAINT, LINES, PAGE, SHADES, new_figure, panel_label, save, styled
from touchline.trials.arms import TIERS
from touchline.trials.cell import Cell
from touchline.trials.scene import arm_and_skin

SIZE = (520, 640)  # pixels of one view
POSES = {
    "panda": (0.3, -0.5, 0.2, -1.9, 0.3, 1.6, 0.6),
    "ur10": (0.3, -1.1, 1.4, -0.8, -1.2, 0.4),
}
SARA = (0.35, 0.62, -0.25, 1.15, 0.35, 0.75, 0.0)
SPAN = (1e-2, 2e3)  # mm, of the distances that are drawn
ROOM = 1.5  # the colours reach so much beyond what nearly all of the values are
VIEWS = ((1.0, -1.0, 0.45), (-1.0, 1.0, 0.45))  # from where


def save_figures(folder: Path, trials: Sequence[Trial]) -> list[str]:
    """Writes all figures that the trials allow into a folder; returns their names."""
    names = []
    trials = [trial for trial in trials if trial.cell.begin != "segments"]
    for arm in dict.fromkeys(trial.cell.arm for trial in trials):
        own = [trial for trial in trials if trial.cell.arm == arm]
        save(distributions(own), folder, name := f"errors_{arm}")
        names.append(name)
        noisy = [t for t in own if t.cell.contacts == 1 and t.cell.tier and not t.cell.speed]
        if noisy:
            tier = min(noisy, key=lambda trial: abs(trial.cell.tier - 2)).cell.tier
            of_tier = [trial for trial in noisy if trial.cell.tier == tier]
            save(coloured_arm(of_tier), folder, name := f"arm_{arm}")
            names.append(name)
    return names


def coloured_arm(trials: Sequence[Trial]) -> Any:
    """An arm from two sides, by the error of single contacts and by what the estimator says of it.

    Args:
        trials: of one cell with one contact.
    """
    cell = trials[0].cell
    _, skin = arm_and_skin(cell.arm, cell.tier)
    touches = [trial.touches[0] for trial in trials]
    links = [touch.link for touch in touches]
    points = np.array([[touch.x, touch.y, touch.z] for touch in touches])
    errors = np.array([touch.error if np.isfinite(touch.error) else 1.0 for touch in touches])
    stds = np.array([touch.std if np.isfinite(touch.std) else 1.0 for touch in touches])
    q = np.array(POSES.get(cell.arm, SARA))
    maps = {
        "error, median of the nearest touches": SurfaceMap(skin, links, points, errors),
        "standard deviation that the estimator states": SurfaceMap(skin, links, points, stds),
    }
    ends = _ends(np.concatenate([errors, stds]))
    figure = new_figure(PAGE, 2.6)
    with styled():
        grid = figure.subplots(1, 5, gridspec_kw={"width_ratios": [1, 1, 1, 1, 0.06]})
        for i, (title, values) in enumerate(maps.items()):
            for j, direction in enumerate(VIEWS):
                axes = grid[2 * i + j]
                image = values.render(q, framing(skin, q, SIZE, direction), SIZE, ends)
                axes.imshow(image)
                axes.axis("off")
                if j == 0:
                    axes.set_title(title, loc="left", pad=3)
        _colour_bar(figure, grid[-1], ends)
        figure.suptitle(f"{cell.arm}, one contact of 20 N, {TIERS[cell.tier]}", fontsize=8)
    return figure


def _ends(values: Array) -> tuple[float, float]:
    """Values [m] of the ends of the colours."""
    low, high = np.quantile(np.maximum(values, 1e-5), [0.05, 0.95])
    return float(low) / ROOM, float(high) * ROOM


def _colour_bar(figure: Any, axes: Any, ends: tuple[float, float]) -> None:
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import LogNorm

    low, high = (1e3 * end for end in ends)
    bar = figure.colorbar(ScalarMappable(LogNorm(low, high), "viridis"), cax=axes)
    bar.set_label("mm")
    ticks = [
        x for ten in (0.01, 0.1, 1, 10, 100) for x in (ten, 2 * ten, 5 * ten) if low < x < high
    ]
    bar.set_ticks(ticks, labels=[f"{tick:g}" for tick in ticks])
    bar.ax.minorticks_off()
    bar.outline.set_visible(False)


def distributions(trials: Sequence[Trial]) -> Any:
    """How many touches are farther off than what: ours by tier and number, and the baselines."""
    still = [cell for cell in dict.fromkeys(trial.cell for trial in trials) if not cell.speed]
    cells = still or list(dict.fromkeys(trial.cell for trial in trials))
    singles = [cell for cell in cells if cell.contacts == 1]
    noisy = [cell.tier for cell in cells if cell.tier] or [0]  # noise-free, there is little to see
    several = [cell for cell in cells if cell.tier == min(noisy)]
    compared = [cell for cell in singles if cell.tier == min(noisy)]
    figure = new_figure(PAGE, 2.5)
    with styled():
        left, middle, right = figure.subplots(1, 3, sharey=True)
        panel_label(left, "one contact")
        for cell in singles:
            noise = f"{TIERS[cell.tier].force:g} N" if cell.tier else "noise-free"
            _curve(left, _errors(trials, cell), noise, SHADES[cell.tier])
        panel_label(middle, f"number, {TIERS[min(noisy)]}")
        for i, cell in enumerate(several):
            label = f"{cell.contacts}, {cell.timing}".strip(", ")
            _curve(middle, _errors(trials, cell), label, SHADES[i])
        panel_label(right, f"rules, {TIERS[min(noisy)]}")
        if compared:
            _baselines(right, trials, compared[0])
        left.set_ylabel("touches farther off [%]")
        for axes in (left, middle, right):
            axes.axvline(1e3 * NEAR, color=FAINT, lw=0.6, ls=":")
            axes.set(xscale="log", yscale="log", xlabel="distance [mm]", xlim=SPAN)
            axes.set_ylim(0.05, 110.0)
            if axes.get_legend_handles_labels()[0]:
                axes.legend(loc="upper right", fontsize=6.5)
    return figure


def _baselines(axes: Any, trials: Sequence[Trial], cell: Cell) -> None:
    _curve(axes, _errors(trials, cell), "ours", SHADES[0], **LINES[5])
    short = {"first": "first entry", "nearest": "nearest to the line", "particles": "particles"}
    for i, name in enumerate(BASELINES):
        errors = [
            error
            for trial in trials
            if trial.cell == cell
            for error in dict(trial.baselines).get(name, ())
        ]
        if errors:
            _curve(axes, np.array(errors), short[name], SHADES[i + 1], **LINES[i])


def _errors(trials: Sequence[Trial], cell: Cell) -> Array:
    return np.array([t.error for trial in trials if trial.cell == cell for t in trial.touches])


def _curve(axes: Any, errors: Array, label: str, color: str, **look: Any) -> None:
    """Share of the touches that are farther off [%]; what was not located is infinitely far."""
    far = np.sort(np.where(np.isfinite(errors), errors, np.inf))
    beyond = 100.0 * (1.0 - np.arange(1, len(far) + 1) / len(far))
    shown = np.isfinite(far)
    x = np.maximum(1e3 * far[shown], SPAN[0])
    axes.step(
        np.r_[SPAN[0], x, SPAN[1]],
        np.r_[100.0, beyond[shown], beyond[shown][-1:] if shown.any() else [100.0]],
        where="post",
        color=color,
        label=label,
        **look,
    )
