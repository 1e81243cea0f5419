# SPDX-License-Identifier: Apache-2.0
"""What is drawn of a robot: the triangles of all its links with smooth normals."""

from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from touchline import _render
from touchline.arrays import Floats, Index
from touchline.model.mechanism import Geometry, Link
from touchline.model.robot import Robot
from touchline.model.surface import Surface, link_surface

CREASE = np.cos(np.deg2rad(35.0))  # edges sharper than this stay sharp


@dataclass(frozen=True)
class Triangles:
    """Triangles to draw.

    Attributes:
        corners: (T, 3, 3) [m].
        normals: (T, 3, 3) unit normals at the corners.
        part: (T,) number of what each belongs to.
    """

    corners: Floats
    normals: Floats
    part: Index

    def moved(self, T: Floats) -> "Triangles":
        """The triangles in another frame, by the pose (4, 4) of this one in it."""
        turned = self.normals @ T[:3, :3].T
        return Triangles(self.corners @ T[:3, :3].T + T[:3, 3], turned, self.part)

    @staticmethod
    def joined(parts: "list[Triangles]") -> "Triangles":
        """All triangles of several, each with its number in the list as its part."""
        if not parts:
            return Triangles(np.zeros((0, 3, 3)), np.zeros((0, 3, 3)), np.zeros(0, np.int64))
        corners = np.concatenate([part.corners for part in parts])
        normals = np.concatenate([part.normals for part in parts])
        counts = [len(part.corners) for part in parts]
        return Triangles(corners, normals, np.repeat(np.arange(len(parts)), counts))


@dataclass(frozen=True)
class Piece:
    """One drawn shape of a link, in the link's frame.

    Attributes:
        link: name of the link.
        triangles: its surface.
        trim: whether it is only drawn, on a link whose other shapes carry contacts.
        closed: whether its back cannot be seen.
    """

    link: str
    triangles: Triangles
    trim: bool
    closed: bool

    @cached_property
    def middles(self) -> Floats:
        """Middles (T, 3) [m] of the triangles."""
        return self.triangles.corners.mean(axis=1)

    @cached_property
    def outline(self) -> Floats:
        """The points (N, 3) [m] that lie farthest out in some direction."""
        from scipy.spatial import ConvexHull, QhullError

        points = np.unique(self.triangles.corners.reshape(-1, 3), axis=0)
        try:
            return points[ConvexHull(points).vertices]
        except (QhullError, ValueError):  # flat, or a few points
            return points


@lru_cache(maxsize=8)
def native_skin(robot: Robot) -> _render.Skin:
    """The drawn shapes of all links for the renderer."""
    pieces = [
        (np.ascontiguousarray(t.corners, np.float64), np.ascontiguousarray(t.normals), p.closed)
        for p in robot_skin(robot)
        for t in [p.triangles]
    ]
    return _render.Skin(pieces)


@lru_cache(maxsize=8)
def robot_skin(robot: Robot) -> tuple[Piece, ...]:
    """The drawn shapes of all links; a mesh that cannot be read is left out."""
    pieces = []
    for link in robot.mechanism.links.values():
        shapes = link.visual or link.collision
        solid = [shape for shape in shapes if _carries(link, shape)]
        for shape in shapes:
            surface = link_surface(replace(link, visual=(shape,), collision=()), "visual")
            if surface is not None:
                trim = bool(solid) and not _carries(link, shape)
                pieces.append(Piece(link.name, smooth(surface), trim, surface.closed))
    return tuple(pieces)


def _carries(link: Link, shape: Geometry) -> bool:
    return any(s.kind == shape.kind and s.path == shape.path for s in link.collision)


def smooth(surface: Surface) -> Triangles:
    """The triangles of a surface with normals averaged over the faces around each corner.

    Weighted by area, over those faces that meet the corner's own at less than the crease angle.
    """
    order = np.argsort(surface.faces.ravel(), kind="stable")
    vertex = surface.faces.ravel()[order]
    counts = np.bincount(vertex, minlength=len(surface.vertices))
    starts = np.cumsum(counts) - counts
    around = counts[vertex]  # how many corners meet at each corner's vertex
    own = np.repeat(order, around)
    step = np.arange(len(own)) - np.repeat(np.cumsum(around) - around, around)
    other = order[np.repeat(starts[vertex], around) + step]
    own_face, other_face = own // 3, other // 3
    normals = surface.normals
    close = np.einsum("ij,ij->i", normals[own_face], normals[other_face]) > CREASE
    own, other_face = own[close], other_face[close]
    pull = normals[other_face] * surface.areas[other_face, None]
    total = np.stack([np.bincount(own, pull[:, i], surface.faces.size) for i in range(3)], axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    flat = np.repeat(normals, 3, axis=0)
    mean = np.where(length > 0, total / np.where(length > 0, length, 1.0), flat)
    part = np.zeros(len(surface.faces), np.int64)
    return Triangles(surface.vertices[surface.faces], mean.reshape(-1, 3, 3), part)
