# SPDX-License-Identifier: Apache-2.0
"""Plots as SVG that is complete as it stands; the page's script makes them zoomable."""

import json
from collections.abc import Sequence
from html import escape
from typing import Any

import numpy as np

from touchline.arrays import Floats
from touchline.report.curves import Curve, Panel

GAP = 3.0  # periods without a sample
STEPS = 2000  # of the vertical range; the paths are in whole steps
LEFT, RIGHT, TOP, BOTTOM = 58, 10, 8, 20  # pixels around the curves, as in report.js


def curve_path(low: Floats, high: Floats, least: float, largest: float, join: int = 0) -> str:
    """A curve as an SVG path of whole numbers, which a script can read back.

    x counts pieces of time, y steps downwards from the top of the range. Each piece goes from one
    extreme to the other, by turns up and down: `M x y v dy l dx dy v dy ...`, a new M after a gap.

    Args:
        low: (P,) smallest values; NaN for pieces without any.
        high: (P,) largest values.
        least: bottom of the range.
        largest: top of the range.
        join: so many empty pieces in a row make no gap.
    """
    scale = STEPS / (largest - least)
    known = np.isfinite(low) & np.isfinite(high)
    rows = np.where(known, np.stack([low, high]), 0.0)
    x = np.flatnonzero(known)
    if not len(x):
        return ""
    bottom, top = np.rint((largest - rows[:, x]) * scale).clip(0, STEPS).astype(int)
    first, last = np.where(x % 2, bottom, top), np.where(x % 2, top, bottom)
    steps = (np.diff(x), first[1:] - last[:-1], (last - first)[1:])
    words = [
        f"l{right} {down}v{on}" if on else f"l{right} {down}"
        for right, down, on in zip(*(step.tolist() for step in steps), strict=True)
    ]
    begins = [0, *(np.flatnonzero(steps[0] > join + 1) + 1).tolist()]
    parts: list[str] = []
    for begin, end in zip(begins, [*begins[1:], len(x)], strict=True):
        on = f"v{last[begin] - first[begin]}" if last[begin] != first[begin] else ""
        parts += [f"M{x[begin]} {first[begin]}{on}", *words[begin : end - 1]]
    return "".join(parts)


def joined(width: float, period: float) -> int:
    """How many empty pieces of a width [s] in a row are no gap, at a period between samples [s]."""
    return max(int(np.ceil(GAP * period / width - 1e-6)) - 1, 0)


def value_range(
    lows: Sequence[Floats], highs: Sequence[Floats], limit: float | None
) -> tuple[float, ...]:
    """Least and largest value that a plot shows: all of its curves, zero, and its limit."""
    least = min([0.0, *(float(np.fmin.reduce(v, initial=np.inf)) for v in lows)])
    largest = max([0.0, *(float(np.fmax.reduce(v, initial=-np.inf)) for v in highs)])
    if limit is not None:
        largest = max(largest, 1.2 * limit)
    room = 0.06 * ((largest - least) or 1.0)
    low = 0.0 if limit is not None else least - room
    return float(f"{low:.6g}"), float(f"{largest + room:.6g}")


def plot(
    panel: Panel,
    curves: Sequence[tuple[Floats, Floats]],
    span: tuple[float, float],
    shaded: Sequence[tuple[float, float, str]] = (),
    size: tuple[int, int] = (640, 120),
    data: dict[str, Any] | None = None,
    attributes: str = "",
    join: int = 0,
) -> str:
    """A plot with its axes, its key and its curves.

    Args:
        panel: what it shows.
        curves: (P,) smallest and (P,) largest values of each of its curves.
        span: time at its left and right [s], as written on the axis.
        shaded: from, to [s] and level of the events on it.
        size: width and height [pixels].
        data: for the script, which adds the range of the paths to it.
        attributes: of the element.
        join: so many empty pieces in a row make no gap.
    """
    limit = panel.limit if panel.band is None else None
    least, largest = value_range([c[0] for c in curves], [c[1] for c in curves], limit)
    width, height = size
    inner = (width - LEFT - RIGHT, height - TOP - BOTTOM)
    pieces = max([len(low) for low, _ in curves] + [1])
    axes = [curve_class(curve) for curve in panel.curves]
    paths = "".join(
        f'<path class="curve s{i}{axis}" d="{curve_path(low, high, least, largest, join)}"/>'
        for i, ((low, high), axis) in enumerate(zip(curves, axes, strict=True))
    )
    if data is not None:
        data = {**data, "low": least, "high": largest, "steps": STEPS, "limit": limit}
        packed = escape(json.dumps(data, separators=(",", ":")), quote=False)
        attributes += " data-plot='{}'".format(packed.replace("'", "&#39;"))
    keys = "".join(
        f'<span class="key s{i}{axis}">{escape(curve.name)}</span>'
        for i, (curve, axis) in enumerate(zip(panel.curves, axes, strict=True))
    )
    # From half a piece before zero: a path stands at the middle of its pieces.
    return (
        f'<div class="plot"{attributes}><header><b>{escape(panel.title)}</b>'
        f'<span class="soft">{escape(panel.unit)}</span>{keys}</header>'
        f'<svg role="img" viewBox="0 0 {width} {height}" aria-label="{escape(panel.title)} over '
        f'time">'
        f"{_axes(least, largest, limit, span, size)}{_shades(shaded, span, inner)}"
        f'<svg x="{LEFT}" y="{TOP}" width="{inner[0]}" height="{inner[1]}" '
        f'viewBox="-0.5 0 {pieces} {STEPS}" preserveAspectRatio="none">{paths}</svg></svg></div>'
    )


def curve_class(curve: Curve) -> str:
    """The classes, after spaces, of its axis and of curves of other results, which are dashed."""
    return axis_class(curve.name.split(",")[0]) + (" beside" if curve.beside else "")


def axis_class(name: str) -> str:
    """The class, after a space, that gives fx to mz the colours of x, y and z; else nothing."""
    is_axis = len(name) == 2 and name[0] in "fm" and name[1] in "xyz"
    return f" axis-{name[1]}" if is_axis else ""


def _axes(
    least: float,
    largest: float,
    limit: float | None,
    span: tuple[float, float],
    size: tuple[int, int],
) -> str:
    """Frame, zero, limit, and the numbers at the ends of the axes."""
    width, height = size
    bottom, right = height - BOTTOM, width - RIGHT

    def at(value: float) -> float:
        return TOP + (largest - value) / (largest - least) * (bottom - TOP)

    lines = [(bottom, "grid"), (TOP, "grid")]
    lines += [(at(0.0), "zero")] if least < 0 < largest else []
    lines += [(at(limit), "limit")] if limit is not None else []
    parts = [f'<path class="{kind}" d="M{LEFT} {y:.1f}H{right}"/>' for y, kind in lines]
    for y, value in ((bottom, least), (TOP + 8, largest)):
        parts.append(f'<text x="{LEFT - 8}" y="{y:.0f}" text-anchor="end">{value:.3g}</text>')
    for x, value, anchor in ((LEFT, span[0], "start"), (right, span[1], "end")):
        words = f"{value:.2f} s"
        parts.append(f'<text x="{x}" y="{height - 5}" text-anchor="{anchor}">{words}</text>')
    return "".join(parts)


def _shades(
    shaded: Sequence[tuple[float, float, str]], span: tuple[float, float], inner: tuple[int, int]
) -> str:
    scale = inner[0] / max(span[1] - span[0], 1e-9)
    parts = []
    for begin, end, level in shaded:
        if end < span[0] or begin > span[1]:
            continue
        x = LEFT + (max(begin, span[0]) - span[0]) * scale
        width = max((min(end, span[1]) - max(begin, span[0])) * scale, 1.0)
        parts.append(
            f'<rect class="event {level}" x="{x:.1f}" y="{TOP}" width="{width:.1f}" '
            f'height="{inner[1]}"/>'
        )
    return "".join(parts)
