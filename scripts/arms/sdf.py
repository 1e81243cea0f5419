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
        return _corner(d_radial, d_axial) - edge

    return field


def pebble(axis: int, radius: float, low: float, high: float, edges: tuple[float, float]) -> Field:
    """A rounded cylinder with its own edge radius at the `low` and at the `high` end."""
    middle = (low + high) / 2
    at_low = rounded_cylinder(axis, radius, low, high + 1.0, edges[0])
    at_high = rounded_cylinder(axis, radius, low - 1.0, high, edges[1])

    def field(points: Array) -> Array:
        return np.where(points[:, axis] < middle, at_low(points), at_high(points))

    return field


def rounded_box(centre: tuple[float, float, float], half: Array, edge: float) -> Field:
    """A box with half edges `half` (3,) about `centre` and edge radius `edge`."""

    def field(points: Array) -> Array:
        q = np.abs(points - np.asarray(centre)) - (half - edge)
        outside = np.linalg.norm(np.maximum(q, 0.0), axis=1)
        return outside + np.minimum(q.max(axis=1), 0.0) - edge

    return field


def revolved(knots: list[tuple[float, float]], edge: float) -> Field:
    """A polygon of (radius, z) `knots` turned about z; convex corners get radius `edge`.

    The polygon starts and ends on the axis and runs upwards along the outside.
    """
    corners = np.array(knots)

    def field(points: Array) -> Array:
        rz = np.column_stack([np.linalg.norm(points[:, :2], axis=1), points[:, 2]])
        return _polygon(rz, corners) - edge

    return field


def loop_tube(half_y: float, low_z: float, high_z: float, corner: float, radius: Profile) -> Field:
    """A tube along a rounded rectangle in the y-z plane; `radius` maps y to the tube's radius."""
    middle, half_z = (low_z + high_z) / 2, (high_z - low_z) / 2

    def field(points: Array) -> Array:
        d_y = np.abs(points[:, 1]) - half_y + corner
        d_z = np.abs(points[:, 2] - middle) - half_z + corner
        in_plane = _corner(d_y, d_z) - corner
        return np.hypot(in_plane, points[:, 0]) - radius(points[:, 1])

    return field


def swept(
    centre_y: Profile, half_x: Profile, half_y: Profile, exponent: Profile
) -> Field:
    """A body along z whose sections are superellipses; every argument is a function of z."""

    def raw(points: Array) -> Array:
        x, y, z = points.T
        n = exponent(z)
        u = np.abs(x / half_x(z)) ** n + np.abs((y - centre_y(z)) / half_y(z)) ** n
        return (np.maximum(u, 1e-12) ** (1.0 / n) - 1.0) * np.minimum(half_x(z), half_y(z))

    return normalized(raw)


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


def smoothstep(low: float, high: float) -> Profile:
    """The quintic step from 0 at `low` to 1 at `high`, twice continuously differentiable."""

    def step(z: Array) -> Array:
        t = np.clip((z - low) / (high - low), 0.0, 1.0)
        return t**3 * (t * (6 * t - 15) + 10)

    return step


def _negative(field: Field) -> Field:
    return lambda points: -field(points)


def _fold(two: Callable[[Array, Array], Array], fields: tuple[Field, ...]) -> Field:
    def field(points: Array) -> Array:
        value = fields[0](points)
        for other in fields[1:]:
            value = two(value, other(points))
        return value

    return field


def _corner(a: Array, b: Array) -> Array:
    """Distance to the quarter plane a < 0, b < 0."""
    return np.hypot(np.maximum(a, 0.0), np.maximum(b, 0.0)) + np.minimum(np.maximum(a, b), 0.0)


def _polygon(points: Array, corners: Array) -> Array:
    """Signed distance of points (N, 2) to a simple polygon (M, 2)."""
    squared = np.full(len(points), np.inf)
    inside = np.zeros(len(points), dtype=bool)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        edge, relative = b - a, points - a
        t = np.clip(relative @ edge / (edge @ edge), 0.0, 1.0)
        if not (a[0] == 0.0 and b[0] == 0.0):  # the axis itself is no surface
            squared = np.minimum(squared, ((relative - t[:, None] * edge) ** 2).sum(axis=1))
        crosses = (a[1] > points[:, 1]) != (b[1] > points[:, 1])
        with np.errstate(divide="ignore", invalid="ignore"):
            at = a[0] + (points[:, 1] - a[1]) * edge[0] / edge[1]
        inside ^= crosses & (points[:, 0] < at)
    return np.where(inside, -1.0, 1.0) * np.sqrt(squared)
