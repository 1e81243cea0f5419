# SPDX-License-Identifier: Apache-2.0
"""Strokes: the way of a finger over a pad, as felt through the arm."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.figure import FELT

SMOOTHING = 0.02  # s, 1 sigma; what a hand writes in 2 s has nothing quicker than some 0.1 s
FIRM = 0.5  # of the median force; a finger that is only just landing or lifting writes nothing
STEP = 5e-4  # m; a point nearer to the smoothed way is never a stray: places are no sharper
FAR = 4.0  # robust standard deviations from the smoothed way; beyond it a point is a stray


@dataclass(frozen=True)
class Stroke:
    """One stroke on a pad.

    Attributes:
        widget: name of the pad.
        link: that carries it.
        points: (N, 3): time [s], u to the right and v up, seen from outside, about the pad's
            middle [m].
        force: (N,) [N].
    """

    widget: str | None
    link: str | None
    points: Array
    force: Array = field(default_factory=lambda: np.empty(0))

    @property
    def duration(self) -> float:
        """From the first point to the last [s]."""
        return float(self.points[-1, 0] - self.points[0, 0]) if len(self.points) else 0.0

    @property
    def length(self) -> float:
        """Of the way [m]."""
        return float(np.linalg.norm(np.diff(self.points[:, 1:], axis=0), axis=1).sum())

    def cleaned(self) -> "Stroke":
        """Without landing, lifting and strays, and smoothed without delay."""
        time, way, force = self.points[:, 0], self.points[:, 1:], self.force
        if len(time) < 3:
            return self
        if len(force) == len(time) and np.isfinite(force).all():
            firm = np.flatnonzero(force >= FIRM * np.median(force))
            keep = slice(firm[0], firm[-1] + 1)
            time, way, force = time[keep], way[keep], force[keep]
        smooth = _smoothed(time, way)
        off = np.linalg.norm(way - smooth, axis=1)
        good = off <= FAR * 1.4826 * np.median(off) + STEP
        if good.sum() >= 3:
            time, way, force = time[good], way[good], force[good] if len(force) else force
            smooth = _smoothed(time, way)
        return Stroke(self.widget, self.link, np.column_stack([time, smooth]), force)

    def as_json(self) -> dict[str, Any]:
        """For JSON: name, link, and points as lists."""
        points = [[float(x) for x in point] for point in self.points]
        force = [float(x) for x in self.force]
        return {"widget": self.widget, "link": self.link, "points": points, "force": force}

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> "Stroke":
        """From what `as_json` returned."""
        points = np.array(data["points"], float).reshape(-1, 3)
        return cls(data["widget"], data["link"], points, np.array(data.get("force", []), float))

    def as_svg(self, margin: float = 0.005) -> str:
        """A picture of it, one millimetre a unit, `margin` [m] around it."""
        way = 1e3 * self.points[:, 1:] * [1.0, -1.0]  # SVG counts y downwards
        low = way.min(axis=0) - 1e3 * margin
        width, height = way.max(axis=0) - low + 1e3 * margin
        line = " ".join(f"{x - low[0]:.2f},{y - low[1]:.2f}" for x, y in way)
        return (
            f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.2f} {height:.2f}" '
            f'width="{width:.2f}mm" height="{height:.2f}mm"><polyline points="{line}" fill="none" '
            f'stroke="{FELT}" stroke-width="1.5" stroke-linecap="round" '
            'stroke-linejoin="round"/></svg>\n'
        )


def _smoothed(time: Array, way: Array) -> Array:
    """A local straight line at each instant, weighted by a Gaussian in time: no delay, no pull."""
    period = float(np.median(np.diff(time))) if len(time) > 1 else SMOOTHING
    reach = int(np.ceil(3 * SMOOTHING / max(period, 1e-6)))
    if reach == 0:
        return way
    out = np.empty_like(way)
    for i, now in enumerate(time):
        part = slice(max(0, i - reach), i + reach + 1)
        t = time[part] - now
        w = np.exp(-0.5 * (t / SMOOTHING) ** 2)
        s0, s1, s2 = w.sum(), w @ t, w @ t**2
        det = s0 * s2 - s1**2
        if det <= 1e-12 * s0 * SMOOTHING**2:
            out[i] = (w @ way[part]) / s0
        else:
            out[i] = ((s2 - s1 * t) * w) @ way[part] / det
    return out


def resampled(way: ArrayLike, count: int) -> Array:
    """`count` points (count, 2) at equal distances along a way (N, 2)."""
    way = np.asarray(way, float)
    steps = np.linalg.norm(np.diff(way, axis=0), axis=1)
    at = np.concatenate([[0.0], np.cumsum(steps)])
    if at[-1] <= 0.0:
        return np.repeat(way[:1], count, axis=0)
    wanted = np.linspace(0.0, at[-1], count)
    return np.column_stack([np.interp(wanted, at, way[:, i]) for i in range(way.shape[1])])
