# SPDX-License-Identifier: Apache-2.0
"""Drawings of figure 4."""

from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.figure import (
    COLORS,
    COLUMN,
    FAINT,
    INK,
    PAGE,
    SHADES,
    legend_above,
    new_figure,
    panel_label,
    styled,
    thin,
)
from touchline.reproduce.experiment import Drawing, Row
from touchline.reproduce.fig4 import JOINT, Outcome
from touchline.reproduce.passage import BEST, SINGULAR

FORCE, MOMENT = slice(0, 3), slice(3, 6)
CEILING = 1e4  # of the drawn condition number


def drawings(outcome: Outcome, table: list[Row]) -> dict[str, Drawing]:
    """The paper's figure, and the peaks over the whole sweep."""
    with styled():
        return {
            "fig4": Drawing(
                _main(outcome),
                f"Disturbance of {outcome.frequency:g} Hz, K = {outcome.bandwidth:g} rad/s. Forces "
                "and moments are norms; the truth is zero. Dotted: the best conditioned "
                "configuration, and the singularity.",
            ),
            "fig4_sweep": Drawing(
                _sweep(table),
                "Largest false force at base and wrist, over the frequency of the disturbance, "
                "one line per bandwidth K [rad/s].",
            ),
        }


def _main(outcome: Outcome) -> Any:
    way = outcome.passage
    figure = new_figure(PAGE, 4.9)
    axes = figure.subplots(4, 2, sharex=True)
    _disturbance(axes[0, 0], outcome)
    _residual_error(axes[0, 1], outcome)
    for column, sensor in enumerate(("base", "wrist")):
        s = way.robot.sensor_names.index(sensor)
        _errors(axes[1, column], outcome, s, FORCE, f"False force, {sensor}", "N")
        _errors(axes[2, column], outcome, s, MOMENT, f"False moment, {sensor}", "Nm")
    _joints(axes[3, 0], outcome)
    _condition(axes[3, 1], outcome)
    for panel in axes.flat:
        for instant in (BEST, SINGULAR):
            panel.axvline(instant, color=FAINT, lw=0.8, ls=(0, (1, 2)), zorder=0)
    for panel in axes[3]:
        panel.set_xlabel("time [s]")
        panel.set_xlim(way.motion.time[0], way.motion.time[-1])
    for panel in axes[1]:
        legend_above(panel, 3)
    figure.align_ylabels(axes)
    return figure


def _disturbance(axes: Any, outcome: Outcome) -> None:
    time, truth, residual = thin(
        outcome.passage.motion.time, outcome.disturbance, outcome.residuals["segment"][:, JOINT]
    )
    axes.plot(time, truth, color=COLORS["truth"], lw=2.2, label="true")
    axes.plot(time, residual, color=COLORS["segment"], label="residual, all methods")
    axes.set_ylabel("Nm")
    panel_label(axes, "Disturbance in joint 5")
    legend_above(axes, 2)


def _residual_error(axes: Any, outcome: Outcome) -> None:
    names = outcome.passage.robot.joint_names
    truth = np.zeros_like(outcome.residuals["segment"])
    truth[:, JOINT] = outcome.disturbance
    time, lag = thin(outcome.passage.motion.time, outcome.residuals["segment"] - truth)
    for j in range(len(names)):
        strong = j == JOINT
        color = COLORS["segment"] if strong else FAINT
        label = "joint 5" if strong else "other joints" if j == 0 else None
        axes.plot(time, lag[:, j], color=color, label=label, zorder=3 if strong else 2)
    axes.set_ylabel("Nm")
    panel_label(axes, "Lag of the residuals")
    legend_above(axes, 2)


def _errors(axes: Any, outcome: Outcome, sensor: int, part: slice, title: str, unit: str) -> None:
    def norm(method: str) -> Array:
        return np.linalg.norm(outcome.wrenches[method][:, sensor, part], axis=1)

    time, classical, closed = thin(
        outcome.passage.motion.time, norm("classical"), norm("closed_form")
    )
    axes.fill_between(time, classical, color=COLORS["classical"], alpha=0.15, lw=0)
    axes.plot(time, classical, color=COLORS["classical"], label="classical")
    axes.plot(
        time, closed, color=COLORS["closed form"], lw=0.8, ls=(0, (2, 2)), label="closed form"
    )
    extended = np.maximum(norm("paper"), norm("segment"))
    axes.plot(time, thin(extended)[0], color=COLORS["segment"], lw=1.6, label="extended")
    axes.set_ylim(-0.04 * classical.max(), 1.4 * classical.max())
    axes.set_ylabel(unit)
    axes.text(
        0.99,
        0.9,
        f"classical ≤ {classical.max():.2g} {unit},  extended ≤ {_power(extended.max())} {unit}",
        transform=axes.transAxes,
        ha="right",
        va="center",
    )
    panel_label(axes, title)


def _power(value: float) -> str:
    digits, exponent = f"{value:.1e}".split("e")
    return f"${digits}\\cdot 10^{{{int(exponent)}}}$"


def _joints(axes: Any, outcome: Outcome) -> None:
    time, q = thin(outcome.passage.motion.time, outcome.passage.motion.q)
    for j in range(q.shape[1]):
        axes.plot(time, q[:, j], color=SHADES[j], lw=0.9, label=f"{j + 1}")
    axes.set_ylabel("rad")
    legend_above(axes, q.shape[1])
    panel_label(axes, "Joints 1 to 7")


def _condition(axes: Any, outcome: Outcome) -> None:
    way = outcome.passage
    axes.semilogy(way.motion.time, np.minimum(way.condition, 10 * CEILING), color=INK, lw=0.9)
    axes.set_ylim(3, CEILING)
    for instant, name in ((BEST, "best"), (SINGULAR, "singular")):
        axes.annotate(
            name,
            (instant, CEILING / 2.5),
            xytext=(4, 0),
            textcoords="offset points",
            color=INK,
            bbox={"facecolor": "white", "alpha": 0.75, "lw": 0, "pad": 0.5},
        )
    panel_label(axes, "Condition number of the end effector's Jacobian")


def _sweep(table: list[Row]) -> Any:
    figure = new_figure(COLUMN, 2.5)
    axes = figure.subplots(1, 2, sharey=True, sharex=True)
    bandwidths = sorted({float(row["bandwidth"] or 0) for row in table})
    for panel, sensor in zip(axes, ("base", "wrist"), strict=True):
        for method in ("classical", "paper", "segment"):
            for i, bandwidth in enumerate(bandwidths):
                _peaks(panel, table, sensor, method, bandwidth, 1 - 0.2 * i)
        panel.set_xlabel("frequency [Hz]")
        panel.set_xticks([0.5, 1, 2, 5], ["0.5", "1", "2", "5"])
        panel.minorticks_off()
        panel_label(panel, sensor.capitalize())
    axes[0].set_ylabel("largest false force [N]")
    values = ", ".join(f"{bandwidth:g}" for bandwidth in bandwidths)
    for height, words, method in (
        (0.58, f"classical, from above\nK = {values}", "classical"),
        (0.21, "extended: paper's form,\nsegment form (dashed)", "segment"),
    ):
        axes[0].text(0.05, height, words, color=COLORS[method], transform=axes[0].transAxes)
    return figure


def _peaks(
    axes: Any, table: list[Row], sensor: str, method: str, bandwidth: float, strength: float
) -> None:
    points = sorted(
        (float(row["frequency"] or 0), float(row["force_max"] or 0))
        for row in table
        if (row["sensor"], row["method"], row["bandwidth"]) == (sensor, method, bandwidth)
    )
    x, y = zip(*points, strict=True)
    dashed = method == "segment"
    axes.loglog(
        x,
        y,
        color=COLORS[method],
        alpha=strength,
        marker="o",
        ms=2,
        ls=(0, (3, 2)) if dashed else "-",
    )
