# SPDX-License-Identifier: Apache-2.0
"""Pictures of what was identified: residuals before and after, friction over speed."""

from pathlib import Path
from typing import Any

import numpy as np

from touchline.errors import InputError
from touchline.figure import FAINT, SHADES, new_figure, panel_label, rendered, styled
from touchline.identify.fit import Column, column_of
from touchline.identify.identification import Identification

BEFORE, AFTER = FAINT, SHADES[0]
PER_ROW = 4  # panels beside each other


def draw_identification(found: Identification, folder: Path) -> list[Path]:
    """Draws `residuals.svg` and, where friction was found, `friction.svg`.

    Raises:
        InputError: the folder cannot be written.
        ModuleNotFoundError: matplotlib is missing.
    """
    with styled():
        pictures = {"residuals.svg": _residuals(found), "friction.svg": _friction(found)}
    written = []
    try:
        folder.mkdir(parents=True, exist_ok=True)
        for name, figure in pictures.items():
            if figure is not None:
                (folder / name).write_bytes(rendered(figure, "svg"))
                written.append(folder / name)
    except OSError as error:
        raise InputError(f"--pictures {folder}: cannot be written: {error.strerror}") from None
    return written


def _residuals(found: Identification) -> Any:
    """RMS by row on data that played no part; forces and moments in panels of their own."""
    e = found.evidence
    used = np.flatnonzero(e.used)
    force = np.array([r >= e.joints and e.rows.names[r][-2] == "f" for r in used])
    groups = [(used[~force], "Nm"), (used[force], "N")]
    groups = [(rows, unit) for rows, unit in groups if len(rows)]
    figure = new_figure(0.5 * len(used) + 2.0, 2.6)
    widths = [len(rows) for rows, _ in groups]
    panels = figure.subplots(1, len(groups), squeeze=False, width_ratios=widths)[0]
    for axes, (rows, unit) in zip(panels, groups, strict=True):
        x = np.arange(len(rows))
        axes.bar(x - 0.2, found.before[rows], 0.4, color=BEFORE, label="as described")
        axes.bar(x + 0.2, found.after[rows], 0.4, color=AFTER, label="identified")
        names = [e.rows.names[r] for r in rows]
        axes.set_xticks(x, names, rotation=35, ha="right")
        axes.set_ylabel(f"residual, RMS [{unit}]")
        axes.grid(axis="x", visible=False)
    panels[0].legend()
    panel_label(panels[0], f"data that played no part ({found.parted})")
    return figure


def _friction(found: Identification) -> Any:
    """Per joint what is left without its friction, over speed, and the law that was found."""
    e = found.evidence
    kinds = ("coulomb", "stribeck", "viscous", "bias")
    columns = [c for c in found.problem.columns if c.row < e.joints and c.kind in kinds]
    joints = sorted({c.row for c in columns if c.kind != "bias"})
    if not joints:
        return None
    left, speed = found.left()[~found.touched], e.speed[~found.touched]
    part = e.part(~found.touched)
    lines = -(-len(joints) // PER_ROW)
    wide = min(PER_ROW, len(joints))
    figure = new_figure(2.2 * wide, 1.9 * lines + 0.3)
    panels = figure.subplots(lines, wide, squeeze=False).ravel()
    for axes in panels[len(joints) :]:
        axes.axis("off")
    for axes, j in zip(panels, joints, strict=False):
        own = [c for c in columns if c.row == j]
        explained = sum(found.solution.value(c.kind, j) * column_of(part, c, j) for c in own)
        # What the joint shows beside all other parameters has the sign of a reading.
        axes.plot(speed[:, j], explained - left[:, j], ".", ms=1.5, color=BEFORE, rasterized=True)
        most = float(np.abs(speed[:, j]).max())
        x = np.linspace(-most, most, 400)
        y = sum(found.solution.value(c.kind, j) * _law(c, x) for c in own)
        axes.plot(x, y, color=AFTER, lw=1.6)
        panel_label(axes, e.rows.names[j])
    figure.supxlabel("velocity [rad/s]", fontsize=8)
    figure.supylabel("friction and offset [Nm]", fontsize=8)
    return figure


def _law(column: Column, speed: np.ndarray) -> np.ndarray:
    if column.kind == "coulomb":
        return np.tanh(speed / column.width)
    if column.kind == "stribeck":
        return np.tanh(speed / column.width) * np.exp(-((speed / column.speed) ** 2))
    return speed if column.kind == "viscous" else np.ones_like(speed)
