# SPDX-License-Identifier: Apache-2.0
"""Simple solids to mark things with: arrows, balls, ellipsoids, rods."""

from functools import cache

import numpy as np

from touchline.arrays import Floats
from touchline.model.transforms import pose, rotation_to_axis
from touchline.report.render.skin import Triangles

SIDES = 32


def arrow(tail: Floats, tip: Floats, radius: float) -> Triangles:
    """A round arrow from `tail` (3,) to `tip` (3,) [m], its shaft of the radius [m]."""
    length = float(np.linalg.norm(tip - tail))
    head = min(6.5 * radius, 0.7 * length)
    wide = 2.6 * radius * head / (6.5 * radius)
    profile = [(0, 0), (0, radius), (length - head, radius), (length - head, wide), (length, 0)]
    return _turned(np.array(profile, float)).moved(_frame(tail, tip - tail))


def rod(start: Floats, end: Floats, radius: float) -> Triangles:
    """A round rod between two points (3,) [m]."""
    length = float(np.linalg.norm(end - start))
    profile = np.array([(0, 0), (0, radius), (length, radius), (length, 0)], float)
    return _turned(profile).moved(_frame(start, end - start))


def ball(centre: Floats, radius: float) -> Triangles:
    """A ball about `centre` (3,) [m]."""
    return ellipsoid(centre, np.eye(3) * radius)


def ellipsoid(centre: Floats, axes: Floats) -> Triangles:
    """An ellipsoid about `centre` (3,) [m] with half axes in the columns of `axes` (3, 3) [m]."""
    sphere = _sphere()
    corners = sphere.corners @ axes.T + centre
    normals = sphere.corners @ np.linalg.inv(axes)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    return Triangles(corners, normals, sphere.part)


def spread(covariance: Floats, sigmas: float, least: float) -> Floats:
    """Half axes (3, 3), in columns [m], of the ellipsoid of a covariance (3, 3) [m2].

    Args:
        covariance: of a position.
        sigmas: how many standard deviations out.
        least: half axes are at least this long [m], so that a flat one can be drawn.
    """
    variances, directions = np.linalg.eigh((covariance + covariance.T) / 2)
    return directions * np.maximum(sigmas * np.sqrt(variances.clip(0)), least)


@cache
def _sphere() -> Triangles:
    """A ball of radius 1 about the origin."""
    angle = np.linspace(-np.pi / 2, np.pi / 2, SIDES // 2 + 1)
    return _turned(np.column_stack([np.sin(angle), np.cos(angle).clip(0)]))


def _turned(profile: Floats) -> Triangles:
    """The solid that a profile (P, 2) of (z, radius) makes, turning about z."""
    z, r = profile.T
    along, out = np.diff(z), np.diff(r)
    length = np.hypot(along, out)
    across = np.stack([along / length, -out / length], axis=1)  # (radial, z) of each normal
    angle = np.linspace(0, 2 * np.pi, SIDES + 1)
    c, s = np.cos(angle), np.sin(angle)
    points = np.stack([r[:, None] * c, r[:, None] * s, np.repeat(z[:, None], SIDES + 1, 1)], 2)
    ring = np.stack(
        [across[:, :1] * c, across[:, :1] * s, np.repeat(across[:, 1:], SIDES + 1, 1)], 2
    )
    lower, upper = points[:-1], points[1:]
    quads = lower[:, :-1], lower[:, 1:], upper[:, 1:], upper[:, :-1]
    a, b, d, e = (quad.reshape(-1, 3) for quad in quads)
    n, m = ring[:, :-1].reshape(-1, 3), ring[:, 1:].reshape(-1, 3)
    corners = np.concatenate([np.stack([a, b, d], 1), np.stack([a, d, e], 1)])
    normals = np.concatenate([np.stack([n, m, m], 1), np.stack([n, m, n], 1)])
    return Triangles(corners, normals, np.zeros(len(corners), np.int64))


def _frame(origin: Floats, direction: Floats) -> Floats:
    """A pose (4, 4) whose z axis lies along the direction."""
    return pose(rotation_to_axis(direction / np.linalg.norm(direction)), np.asarray(origin, float))
