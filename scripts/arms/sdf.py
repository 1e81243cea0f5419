# SPDX-License-Identifier: Apache-2.0
"""Solid shapes as signed distance fields, and the operators that fillet them together.

A field maps points (N, 3) [m] to (N,) [m]: negative inside, positive outside. Every function here
returns a field, so that a link reads as a sentence. The rounded operators give circular fillets of
the stated radius where both arguments are true distances.
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Field = Callable[[Array], Array]
Profile = Callable[[Array], Array]


def rounded_cylinder(axis: int, radius: float, low: float, high: float, edge: float) -> Field:
    """A cylinder along coordinate `axis` between `low` and `high` with edge radius `edge`."""
    others = [i for i in range(3) if i != axis]
    middle, half = (low + high) / 2, (high - low) / 2

    def field(points: Array) -> Array:
        d_radial = np.linalg.norm(points[:, others], axis=1) - radius + edge
        d_axial = np.abs(points[:, axis] - middle) - half + edge
        return corner(d_radial, d_axial) - edge

    return field


def rounded_box(centre: tuple[float, float, float], half: Array, edge: float) -> Field:
    """A box with half edges `half` (3,) about `centre` and edge radius `edge`."""

    def field(points: Array) -> Array:
        q = np.abs(points - np.asarray(centre)) - (half - edge)
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0) - edge

    return field


def loop_tube(half_y: float, low_z: float, high_z: float, bend: float, radius: Profile) -> Field:
    """A tube along a rounded rectangle in the y-z plane; `radius` maps z to the tube's radius."""
    middle, half_z = (low_z + high_z) / 2, (high_z - low_z) / 2

    def field(points: Array) -> Array:
        d_y = np.abs(points[:, 1]) - half_y + bend
        d_z = np.abs(points[:, 2] - middle) - half_z + bend
        in_plane = corner(d_y, d_z) - bend
        return np.hypot(in_plane, points[:, 0]) - radius(points[:, 2])

    return field


def column(radius: Profile, low: float, high: float) -> Field:
    """A body of revolution about z with `radius` as a function of z, cut flat at both ends."""

    def side(points: Array) -> Array:
        return np.hypot(points[:, 0], points[:, 1]) - radius(points[:, 2])

    return intersection(0.0, normalized(side), half_space(2, low, -1), half_space(2, high, 1))


def normalized(field: Field, step: float = 1e-4) -> Field:
    """First-order distance of a field that is only an implicit function: f / |grad f|."""

    def result(points: Array) -> Array:
        length = np.linalg.norm(gradient(field, points, step), axis=1)
        return field(points) / np.maximum(length, 0.2)

    return result


def gradient(field: Field, points: Array, step: float = 1e-5) -> Array:
    """Central differences of `field` at `points`, (N, 3)."""
    columns = []
    for i in range(3):
        offset = np.zeros(3)
        offset[i] = step
        columns.append((field(points + offset) - field(points - offset)) / (2 * step))
    return np.column_stack(columns)


def half_space(axis: int, level: float, sign: int) -> Field:
    """Everything with `sign * (coordinate - level) < 0`."""
    return lambda points: sign * (points[:, axis] - level)


def union(radius: float, *fields: Field) -> Field:
    """All of `fields`, with a concave fillet of `radius` where they meet."""

    def two(a: Array, b: Array) -> Array:
        if radius == 0.0:
            return np.minimum(a, b)
        inner = np.hypot(np.maximum(radius - a, 0.0), np.maximum(radius - b, 0.0))
        return np.maximum(radius, np.minimum(a, b)) - inner

    return _fold(two, fields)


def intersection(radius: float, *fields: Field) -> Field:
    """What all `fields` share, with a convex fillet of `radius` on the new edges."""

    def two(a: Array, b: Array) -> Array:
        if radius == 0.0:
            return np.maximum(a, b)
        outer = np.hypot(np.maximum(radius + a, 0.0), np.maximum(radius + b, 0.0))
        return np.minimum(-radius, np.maximum(a, b)) + outer

    return _fold(two, fields)


def difference(radius: float, body: Field, *tools: Field) -> Field:
    """`body` without `tools`, with a convex fillet of `radius` on the new edges."""
    return intersection(radius, body, *[_negative(tool) for tool in tools])


def moved(field: Field, T_link_shape: Array) -> Field:
    """`field` placed at the pose `T_link_shape` (4, 4); a reflection is allowed."""
    inverse = np.linalg.inv(T_link_shape)
    return lambda points: field(points @ inverse[:3, :3].T + inverse[:3, 3])


def quintic(t: Array) -> Array:
    """The step from 0 at t = 0 to 1 at t = 1, twice continuously differentiable."""
    t = np.clip(t, 0.0, 1.0)
    return t**3 * (t * (6 * t - 15) + 10)


def smoothstep(low: float, high: float) -> Profile:
    """The quintic step from 0 at `low` to 1 at `high`."""
    return lambda z: quintic((z - low) / (high - low))


def _negative(field: Field) -> Field:
    return lambda points: -field(points)


def _fold(two: Callable[[Array, Array], Array], fields: tuple[Field, ...]) -> Field:
    def field(points: Array) -> Array:
        value = fields[0](points)
        for other in fields[1:]:
            value = two(value, other(points))
        return value

    return field


def corner(a: Array, b: Array) -> Array:
    """Distance to the quarter plane a < 0, b < 0."""
    return np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0)) + np.minimum(np.maximum(a, b), 0.0)
