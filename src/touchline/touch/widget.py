# SPDX-License-Identifier: Apache-2.0
"""Widgets: named areas on a link's surface, and what a touch of them says."""

from dataclasses import dataclass
from math import erf

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.description import WidgetDescription

DEPTH = 0.03  # m; a touch farther than this from a pad's plane or a dial's is not on it


@dataclass(frozen=True)
class Reading:
    """Where a touch lies relative to a widget.

    Attributes:
        beyond: how far outside of the widget's rim [m]; negative inside.
        value: of a slider its part of the way (0 to 1), of a dial the angle [rad], of a pad
            `(u, v)` [m]; None for a button.
    """

    beyond: float
    value: float | tuple[float, float] | None = None


class Widget:
    """One entry of `interface`.

    Args:
        name: of the widget.
        given: its description.
        normal: (3,) outward at the middle of a pad, in the link's frame; default: as described.

    Attributes:
        name: as given, and `kind`, `link`, `force`, `most` as described.
    """

    def __init__(self, name: str, given: WidgetDescription, normal: Array | None = None) -> None:
        self.name, self.kind, self.link = name, given.kind, given.link
        self.force, self.most, self.given = given.force, given.most, given
        if given.kind == "slider":
            self._path = np.array(given.path)
            self._steps = np.diff(self._path, axis=0)
            self._lengths = np.linalg.norm(self._steps, axis=1)
            if not self._lengths.all():
                raise InputError(f"interface.{name}.path: two neighbouring points are equal")
        if given.kind in ("pad", "dial"):
            self._axes = _axes(name, given, normal)

    @property
    def whole(self) -> bool:
        """Whether it is its whole link, or taught without a place."""
        return self.kind != "slider" and self.given.at is None

    @property
    def reach(self) -> float:
        """From its middle to the nearest rim [m]; infinite for a whole link."""
        if self.whole:
            return np.inf
        if self.kind == "slider":
            return self.given.width / 2
        return min(self.given.size) / 2 if self.given.size else self.given.radius or 0.0

    @property
    def length(self) -> float:
        """Of a slider's way [m]."""
        return float(self._lengths.sum())

    def read(self, point: Array) -> Reading:
        """Where a point (3,) [m] in the link's frame lies on the widget."""
        given = self.given
        if self.kind == "slider":
            return self._read_slider(point)
        if given.at is None:
            return Reading(-np.inf)  # the whole link
        from_middle = point - np.array(given.at)
        if self.kind in ("button", "toggle"):
            return Reading(float(np.linalg.norm(from_middle)) - (given.radius or 0.0))
        u, v, n = self._axes @ from_middle
        if self.kind == "dial":
            rim = float(np.hypot(u, v)) - (given.radius or 0.0)
            return Reading(max(rim, abs(n) - DEPTH), float(np.arctan2(v, u)))
        width, height = given.size or (0.0, 0.0)
        beyond = max(abs(u) - width / 2, abs(v) - height / 2, abs(n) - DEPTH)
        return Reading(float(beyond), (float(u), float(v)))

    def _read_slider(self, point: Array) -> Reading:
        part = np.einsum("ij,ij->i", point - self._path[:-1], self._steps) / self._lengths**2
        part = np.clip(part, 0.0, 1.0)
        aside = np.linalg.norm(point - self._path[:-1] - part[:, None] * self._steps, axis=1)
        i = int(np.argmin(aside))
        way = self._lengths[:i].sum() + part[i] * self._lengths[i]
        return Reading(float(aside[i]) - self.given.width / 2, float(way / self.length))

    def probability(self, point: Array, std: float) -> float:
        """That a touch at `point` (3,) [m], uncertain by `std` [m], is on the widget.

        `std` is the root of the covariance's trace; across a rim counts one of two directions
        along the surface.
        """
        beyond = self.read(point).beyond
        if beyond == -np.inf:
            return 1.0
        return 0.5 * (1.0 - erf(beyond / max(std, 1e-6)))  # std / sqrt(2) per direction

    def scaled(self, value: float) -> float:
        """A slider's value in its `range`."""
        low, high = self.given.range
        return low + value * (high - low)

    def point_at(self, value: float) -> Array:
        """The point (3,) [m] of a slider at a part of its way, 0 to 1."""
        way = value * self.length
        i = int(np.searchsorted(np.cumsum(self._lengths), way).clip(0, len(self._steps) - 1))
        part = (way - self._lengths[:i].sum()) / self._lengths[i]
        return self._path[i] + part * self._steps[i]

    def plane(self) -> tuple[Array, Array, Array]:
        """Unit vectors u, v, n (3,) of a pad or dial in the link's frame, n outward."""
        u, v, n = self._axes
        return u, v, n


def _axes(name: str, given: WidgetDescription, normal: Array | None) -> Array:
    """Rows u, v, n of a dial's or pad's plane: seen from outside u to the right, v up."""
    if given.normal is not None:
        normal = np.array(given.normal)
    if normal is None:
        raise InputError(f"interface.{name}: give its `normal`; link '{given.link}' has no surface")
    n = normal / np.linalg.norm(normal)
    # A dial's zero may point anywhere: along the frame's axis that lies flattest.
    up = np.eye(3)[int(np.argmin(np.abs(n)))] if given.up is None else np.array(given.up)
    v = up - (up @ n) * n
    if np.linalg.norm(v) < 1e-3 * np.linalg.norm(up):
        raise InputError(f"interface.{name}.up: {given.up} stands on the surface, not along it")
    v /= np.linalg.norm(v)
    return np.array([np.cross(v, n), v, n])
