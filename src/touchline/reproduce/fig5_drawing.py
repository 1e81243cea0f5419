# SPDX-License-Identifier: Apache-2.0
"""Drawing of figure 5."""

from typing import Any

import numpy as np

from touchline.figure import (
    COLORS,
    FAINT,
    INK,
    PAGE,
    legend_above,
    new_figure,
    panel_label,
    styled,
    thin,
)
from touchline.reproduce.arm_view import ArmView
from touchline.reproduce.experiment import Drawing
from touchline.reproduce.fig5 import (
    HAND,
    RECOIL,
    SEGMENTS,
    STRONG,
    STRUCTURE,
    Recoil,
    point_errors,
)
from touchline.reproduce.fig5 import ghost as ghost_of
from touchline.reproduce.overlapping import Pushes
from touchline.reproduce.replay import FORCE, Replay

TONES = {STRUCTURE: "#1f5d94", HAND: "#c8602c"}
NAMES = {STRUCTURE: "structure", HAND: "end effector"}
BEFORE = 0.15  # the first picture, before anything touches [s]


def drawings(pushes: Pushes, after: list[Recoil]) -> dict[str, Drawing]:
    """The arm at several instants over the curves."""
    replay = pushes.noisy
    first, second = after
    instants = (
        BEFORE,
        first.start - 1.1,
        first.start - 0.1,
        first.start + 0.12,
        second.start - 0.1,
        second.start + 0.12,
    )
    with styled():
        figure = new_figure(PAGE, 5.9)
        upper, lower = figure.subfigures(2, 1, height_ratios=(1.0, 3.5))
        _pictures(upper, replay, instants)
        axes = lower.subplots(3, 2, sharex=True)
        _forces(axes[0, 0], replay)
        _force_errors(axes[0, 1], replay)
        _speed(axes[1, 0], replay)
        _points(axes[1, 1], replay)
        for panel, segment in zip(axes[2], SEGMENTS, strict=True):
            _ghosts(panel, pushes.ideal, segment)
        for panel in axes.flat:
            _marks(panel, instants, after)
        for panel in axes[-1]:
            panel.set_xlabel("time [s]")
            panel.set_xlim(replay.time[0], replay.time[-1])
        for number, instant in enumerate(instants, 1):
            axes[1, 0].text(
                instant, 0.92, str(number), ha="center", va="center", fontsize=7, zorder=6,
                transform=axes[1, 0].get_xaxis_transform(),
                bbox={"boxstyle": "circle,pad=0.15", "fc": "white", "ec": INK, "lw": 0.5},
            )  # fmt: skip
        return {"fig5": Drawing(figure, CAPTION)}


CAPTION = (
    "Above: the arm at six instants, numbered below; grey arrows: true forces, rings: true points, "
    "dots: points located from the sensors. Below: norms of the forces (grey: true). Then their "
    "errors beyond the filter's lag, and those of the located points, while the true force is over "
    "10 N. Then joint velocities. Last what is false in the forces with ideal sensors: in the "
    "printed form a ghost of the other contact, and of the segment's own in a turning frame. "
    "Shaded: the arm springs back."
)


def _pictures(figure: Any, replay: Replay, instants: tuple[float, ...]) -> None:
    view = ArmView(replay.robot, azimuth=-0.4, elevation=0.35)
    rows = [int(np.argmin(np.abs(replay.time - t))) for t in instants]
    configurations = replay.signals[1][rows]
    for number, (axes, row) in enumerate(zip(figure.subplots(1, len(rows)), rows, strict=True), 1):
        view.draw(axes, replay.signals[1][row])
        for segment in SEGMENTS:
            force, point = replay.true_force(segment)[row], replay.true_point(segment)[row]
            if np.isfinite(point).all():
                view.force(axes, point, 0.6 * force, FAINT)
                view.ring(axes, point, FAINT, 7)
            located = replay.located(segment)[row]
            if np.isfinite(located).all():
                view.point(axes, located, TONES[segment], 4)
        view.frame(axes, configurations)
        axes.set_title(f"{number}: {replay.time[row]:.2f} s", fontsize=7.5, pad=1)


def _marks(axes: Any, instants: tuple[float, ...], after: list[Recoil]) -> None:
    for recoil in after:
        axes.axvspan(recoil.start, recoil.start + RECOIL, color=FAINT, alpha=0.13, lw=0, zorder=0)
    for instant in instants:
        axes.axvline(instant, color=FAINT, lw=0.6, ls=(0, (1, 2)), zorder=0)


def _forces(axes: Any, replay: Replay) -> None:
    for segment in SEGMENTS:
        true = np.linalg.norm(replay.true_force(segment), axis=1)
        ours = np.linalg.norm(replay.wrench(segment)[:, FORCE], axis=1)
        time, true, ours = thin(replay.time, true, ours)
        axes.plot(time, true, color=FAINT, lw=2.4, alpha=0.6)
        axes.plot(time, ours, color=TONES[segment], label=NAMES[segment])
    axes.set_ylim(bottom=0)
    axes.set_ylabel("N")
    panel_label(axes, "Contact forces")
    legend_above(axes, 2)


def _force_errors(axes: Any, replay: Replay) -> None:
    for segment in SEGMENTS:
        strong = np.linalg.norm(replay.true_force(segment), axis=1) > STRONG
        error = np.where(strong, ghost_of(replay, segment, "segment"), np.nan)
        time, error = thin(replay.time, error)
        axes.semilogy(time, error, color=TONES[segment], lw=0.7)
    axes.set_ylim(3e-3, 3.0)
    axes.set_ylabel("N")
    panel_label(axes, "Error of the forces")


def _points(axes: Any, replay: Replay) -> None:
    for segment in SEGMENTS:
        time, error = thin(replay.time, point_errors(replay, segment))
        axes.semilogy(time, 1e3 * error, color=TONES[segment], lw=0.9)
    axes.set_ylim(0.05, 50)
    axes.set_ylabel("mm")
    panel_label(axes, "Error of the located points")


def _speed(axes: Any, replay: Replay) -> None:
    speed = np.linalg.norm(replay.signals[2], axis=1)
    time, speed = thin(replay.time, speed)
    axes.plot(time, speed, color=INK, lw=0.9)
    axes.set_ylim(0, 1.3 * speed.max())
    axes.set_ylabel("rad/s")
    panel_label(axes, "$\\|\\dot{q}\\|$")


def _ghosts(axes: Any, replay: Replay, segment: str) -> None:
    names = {"paper": "as printed, (18)", "segment": "segment form"}
    for method, name in names.items():
        time, force = thin(replay.time, ghost_of(replay, segment, method))
        axes.semilogy(time, np.maximum(force, 1e-6), color=COLORS[method], lw=1.0, label=name)
    axes.set_ylim(1e-5, 1.0)
    axes.set_ylabel("N")
    panel_label(axes, f"False force, {NAMES[segment]}")
    legend_above(axes, 2)
