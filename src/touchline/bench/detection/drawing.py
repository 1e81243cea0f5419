# SPDX-License-Identifier: Apache-2.0
"""Figures of the detection benchmark: share found within the goal against false alarms, delays."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from touchline.bench.detection.outcome import GOALS
from touchline.figure import FAINT, LINES, SHADES, new_figure, panel_label, rendered, styled

Line = dict[str, str]

METHODS = ("rows", "scaled", "chi2", "glrt", "cusum", "lowpass")
LOOKS = {m: LINES[i] | {"color": SHADES[i], "label": m} for i, m in enumerate(METHODS)}
COLUMNS = 3
DELAYS = (0.05, 70.0)  # ms; the same in all panels, so that they can be compared


def draw(lines: list[Line], out: Path) -> None:
    """Writes roc.svg and delay.svg.

    Args:
        lines: of roc.csv.
        out: folder.
    """
    _sheet(lines, _roc, out / "roc.svg")
    _sheet(lines, _delay, out / "delay.svg")


def _roc(axes: Any, lines: list[Line], goal: tuple[float, float]) -> None:
    force, limit = goal
    for (method,), own in _by(lines, "method").items():
        at = [line for line in own if float(line["force_n"]) == force]
        rates = [float(line["alarms_wanted_per_hour"]) for line in at]
        found = [100 * float(line["found_within_goal"]) for line in at]
        axes.semilogx(rates, found, **LOOKS[method])
    axes.set_xticks([0.1, 1.0, 10.0, 100.0], ["0.1", "1", "10", "100"])
    axes.axhline(95, color=FAINT, lw=0.6, ls=":")
    axes.set_ylim(0, 103)
    axes.set_xlabel("false alarms per hour, as set")
    axes.set_ylabel(f"% of {force:g} N found within {1e3 * limit:g} ms")


def _delay(axes: Any, lines: list[Line], goal: tuple[float, float]) -> None:
    for (method,), own in _by(lines, "method").items():
        at = [line for line in own if float(line["alarms_wanted_per_hour"]) == 1.0]
        forces = [float(line["force_n"]) for line in at]
        median = [1e3 * float(line["delay_median_s"]) for line in at]
        axes.loglog(forces, median, marker="o", ms=2.5, **LOOKS[method])
        axes.set_xticks(forces, [f"{force:g}" for force in forces])
    axes.axvline(goal[0], color=FAINT, lw=0.6, ls=":")
    axes.set_xticks([], minor=True)
    axes.set_ylim(*DELAYS)
    axes.set_yticks([0.1, 1.0, 10.0], ["0.1", "1", "10"])
    axes.set_xlabel("force [N]")
    axes.set_ylabel("median delay at 1 per hour [ms]")


def _sheet(
    lines: list[Line],
    panel: Callable[[Any, list[Line], tuple[float, float]], None],
    path: Path,
) -> None:
    settings = dict(sorted(_by(lines, "observer", "rate_hz", "velocity_noise").items(), key=_place))
    columns = min(COLUMNS, len(settings))
    rows = -(-len(settings) // columns)
    figure = new_figure(2.6 * columns, 2.2 * rows + 0.3)
    with styled():
        grid = figure.subplots(rows, columns, squeeze=False)
        for axes in grid.flat[len(settings) :]:
            axes.axis("off")
        for axes, (name, own) in zip(grid.flat, settings.items(), strict=False):
            observer, rate, velocity = name
            panel(axes, own, GOALS[float(rate), float(velocity)])
            panel_label(axes, f"{observer}, {float(rate) / 1000:g} kHz, {velocity} rad/s")
        drawn = dict.fromkeys(line["method"] for line in lines)
        shown = {handle.get_label(): handle for axes in grid.flat for handle in axes.get_lines()}
        handles = [shown[method] for method in METHODS if method in drawn]
        place = "outside lower center"
        figure.legend(handles=handles, loc=place, ncols=len(handles), handlelength=2.6)
    path.write_bytes(rendered(figure, "svg"))


def _place(setting: tuple[tuple[str, ...], list[Line]]) -> tuple[Any, ...]:
    """The extended observer first, then by rate; much noise before little."""
    observer, rate, velocity = setting[0]
    return observer != "extended", observer, float(rate), -float(velocity)


def _by(lines: list[Line], *names: str) -> dict[tuple[str, ...], list[Line]]:
    parts: dict[tuple[str, ...], list[Line]] = {}
    for line in lines:
        parts.setdefault(tuple(line[name] for name in names), []).append(line)
    return parts
