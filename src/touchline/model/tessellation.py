# SPDX-License-Identifier: Apache-2.0
"""Triangles of the primitive shapes, closed and with outward faces, in the shape's own frame."""

import numpy as np

from touchline.model.mechanism import Array, Geometry
from touchline.model.mesh_file import Triangles

SEGMENTS = 64  # around; a cylinder of 6 cm is then off by 0.07 mm at most
ARC_STEPS = 16  # from the pole to the equator


def tessellate(shape: Geometry) -> Triangles:
    """Return vertices (V, 3) and faces (F, 3) of a primitive shape (`Geometry.kind`)."""
    if shape.kind == "box":
        return box(np.array(shape.size))
    if shape.kind == "ellipsoid":
        vertices, faces = revolve(_round_ends(1.0, 0.0))
        return vertices * np.array(shape.size), faces
    if shape.kind == "sphere":
        return revolve(_round_ends(shape.size[0], 0.0))
    radius, length = shape.size
    if shape.kind == "capsule":
        return revolve(_round_ends(radius, length))
    half = length / 2
    return revolve(np.array([[0.0, -half], [radius, -half], [radius, half], [0.0, half]]))


def box(edges: Array) -> Triangles:
    """Return the triangles of a box with the full `edges` (3,) about the origin."""
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    # Each side as a quadrilateral, counter-clockwise seen from outside.
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    faces = [triangle for a, b, c, d in quads for triangle in ((a, b, c), (a, c, d))]
    return corners * edges / 2, np.array(faces)


def revolve(profile: Array, segments: int = SEGMENTS) -> Triangles:
    """Return the surface that a profile (P, 2) of (radius, z) sweeps about z.

    The profile runs from its lower pole to its upper pole; both have radius 0.
    """
    angles = np.arange(segments) * 2 * np.pi / segments
    around = np.column_stack([np.cos(angles), np.sin(angles)])
    rings = [np.column_stack([r * around, np.full(segments, z)]) for r, z in profile[1:-1]]
    poles = np.array([[0.0, 0.0, profile[0, 1]], [0.0, 0.0, profile[-1, 1]]])
    here, ahead = np.arange(segments), np.roll(np.arange(segments), -1)
    bottom, top = len(rings) * segments, len(rings) * segments + 1
    last = (len(rings) - 1) * segments
    faces = [np.column_stack([np.full(segments, bottom), ahead, here])]
    for low in range(0, last, segments):
        high = low + segments
        faces.append(np.column_stack([low + here, low + ahead, high + ahead]))
        faces.append(np.column_stack([low + here, high + ahead, high + here]))
    faces.append(np.column_stack([np.full(segments, top), last + here, last + ahead]))
    return np.vstack([*rings, poles]), np.vstack(faces)


def _round_ends(radius: float, length: float) -> Array:
    """Return the profile of a capsule; with length 0 of a sphere."""
    angles = np.linspace(0.0, np.pi / 2, ARC_STEPS + 1)
    arc = radius * np.column_stack([np.sin(angles), -np.cos(angles)]) - [0.0, length / 2]
    arc[0, 0] = 0.0
    upper = arc[::-1] * [1.0, -1.0]
    return np.vstack([arc, upper[0 if length else 1 :]])
