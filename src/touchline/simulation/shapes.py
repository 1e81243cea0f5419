# SPDX-License-Identifier: Apache-2.0
"""The links' surfaces as MuJoCo shapes: exact for rays, in convex pieces for collisions.

MuJoCo collides the convex hull of a mesh, and its rays meet the triangles themselves.
"""

from collections.abc import Iterable, Mapping
from hashlib import sha256
from importlib import import_module
from typing import Any

import numpy as np

from touchline.arrays import Array, Index
from touchline.model.mechanism import Geometry, Mechanism
from touchline.model.surface import Surface, link_surface
from touchline.simulation.mujoco_model import Addition, quaternion

PIECES = 20  # of a link at most
MIN_TRIANGLES = 4
KEPT = 64  # links whose pieces are kept for the next scene
ROBOT, OTHER = 1, 2  # who collides: robot with others, never among themselves

_cut_before: dict[tuple[bytes, int], list[Array]] = {}  # by triangles and number at most


def surfaces_for_rays(surfaces: Mapping[str, Surface]) -> Addition:
    """Adds the true surfaces of links, which rays meet and nothing collides with."""

    def add(spec: Any, bodies: dict[str, Any]) -> None:
        for name, surface in surfaces.items():
            mesh = f"surface:{name}"
            _add_mesh(spec, mesh, surface.vertices, surface.faces)
            _add_geom(spec, bodies[name], "mesh", f"link:{name}", meshname=mesh, contype=0)

    return add


class CollisionShapes:
    """Shapes of links that others collide with: primitives as they are, meshes in convex pieces.

    Args:
        mechanism: whose links.
        pieces: convex pieces of a link at most.
    """

    def __init__(self, mechanism: Mechanism, pieces: int = PIECES) -> None:
        self._mechanism, self._count = mechanism, pieces
        self._cut: dict[str, list[Array]] = {}

    def addition(self, links: Iterable[str]) -> Addition:
        """Adds the shapes of some links to a model."""
        wanted = set(links)
        chosen = [link for link in self._mechanism.links if link in wanted]

        def add(spec: Any, bodies: dict[str, Any]) -> None:
            for name in chosen:
                self._add(spec, bodies[name], name)

        return add

    def pieces(self, link: str) -> list[Array]:
        """The points (P, 3) of each convex piece of a link; none if it is made of primitives."""
        if link not in self._cut:
            surface = link_surface(self._mechanism.links[link])
            if surface is None or self._primitives(link):
                self._cut[link] = []
            else:
                self._cut[link] = convex_pieces(surface, self._count)
        return self._cut[link]

    def depth(self, link: str, point: Array, around: float) -> float:
        """How far the pieces stand off a link's surface near a point of it [m].

        Args:
            link: whose.
            point: (3,) in the link's frame [m].
            around: corners of the surface within this distance count too [m].
        """
        from scipy.spatial import ConvexHull

        surface, pieces = link_surface(self._mechanism.links[link]), self.pieces(link)
        if surface is None or not pieces:
            return 0.0
        near = np.linalg.norm(surface.vertices - point, axis=1) < around
        points = np.vstack([surface.vertices[near], point])
        planes = [ConvexHull(piece).equations for piece in pieces]
        inside = [-(p[:, :3] @ points.T + p[:, 3:]).max(axis=0) for p in planes]
        return max(0.0, float(np.max(inside)))

    def _primitives(self, link: str) -> tuple[Geometry, ...]:
        """A link's shapes if all are primitives."""
        shapes = self._mechanism.links[link].collision or self._mechanism.links[link].visual
        meshes = any(shape.kind in ("mesh", "triangles") for shape in shapes)
        return () if meshes else shapes

    def _add(self, spec: Any, body: Any, link: str) -> None:
        for i, shape in enumerate(self._primitives(link)):
            _add_primitive(spec, body, f"link:{link}:{i}", shape)
        for i, points in enumerate(self.pieces(link)):
            mesh = f"piece:{link}:{i}"
            spec.add_mesh(name=mesh, uservert=points.ravel())
            _add_geom(spec, body, "mesh", f"link:{link}:{i}", meshname=mesh)


def _add_primitive(spec: Any, body: Any, name: str, shape: Geometry) -> None:
    size = np.zeros(3)
    size[: len(shape.size)] = shape.size
    if shape.kind == "box":
        size = size / 2
    elif shape.kind in ("cylinder", "capsule"):
        size[1] /= 2
    T = shape.T_link_shape
    _add_geom(spec, body, shape.kind, name, size=size, pos=T[:3, 3], quat=quaternion(T[:3, :3]))


def _add_mesh(spec: Any, name: str, vertices: Array, faces: Index) -> None:
    shell = import_module("mujoco").mjtMeshInertia.mjMESH_INERTIA_SHELL  # it need not be closed
    spec.add_mesh(
        name=name,
        uservert=vertices.ravel(),
        userface=faces.astype(np.int32).ravel(),
        inertia=shell,
    )


def _add_geom(spec: Any, body: Any, kind: str, name: str, **options: Any) -> None:
    kinds = import_module("mujoco").mjtGeom
    shared = {"contype": ROBOT, "conaffinity": OTHER, "condim": 3, "mass": 0.0}
    if options.get("contype") == 0:
        shared["conaffinity"] = 0
    body.add_geom(name=name, type=getattr(kinds, f"mjGEOM_{kind.upper()}"), **shared | options)


def convex_pieces(surface: Surface, pieces: int = PIECES) -> list[Array]:
    """Points (P, 3) of convex pieces whose hulls follow a surface closely.

    The surface is cut by planes across its own axes, each time where that takes the most from the
    volume of the hulls, until it takes too little or there are enough pieces.

    Args:
        surface: of a link.
        pieces: at most.
    """
    triangles = surface.vertices[surface.faces]
    key = sha256(triangles.tobytes()).digest(), pieces
    if key in _cut_before:
        return list(_cut_before[key])
    found = _cut_before[key] = _cut(triangles, pieces)
    if len(_cut_before) > KEPT:
        del _cut_before[next(iter(_cut_before))]
    return list(found)


def _cut(triangles: Array, pieces: int) -> list[Array]:
    """As `convex_pieces`, which takes about a second for a link, so that the last ones are kept."""
    parts = [_Part(triangles)]
    enough = 2e-3 * parts[0].volume
    while len(parts) < pieces:
        best = max(parts, key=lambda part: part.gain)
        if best.gain < enough:
            break
        parts.remove(best)
        parts += best.halves
    return [part.points for part in parts]


class _Part:
    """A part of a surface, its hull's volume, and what its best cut would gain."""

    def __init__(self, triangles: Array) -> None:
        self.triangles = triangles
        self.points = _distinct(triangles.reshape(-1, 3))
        self.volume = _hull_volume(self.points)
        self._cut: tuple[float, list[_Part]] | None = None

    @property
    def gain(self) -> float:
        """Volume [m3] by which the hulls of the halves are smaller."""
        return self._best()[0]

    @property
    def halves(self) -> "list[_Part]":
        """Both sides of the best cut."""
        return self._best()[1]

    def _best(self) -> "tuple[float, list[_Part]]":
        if self._cut is None:
            cuts = [self._halve(axis, x) for axis in range(3) for x in (0.3, 0.5, 0.7)]
            self._cut = max(cuts, key=lambda cut: cut[0])
        return self._cut

    def _halve(self, axis: int, fraction: float) -> "tuple[float, list[_Part]]":
        low, high = self.points[:, axis].min(), self.points[:, axis].max()
        sides = cut_triangles(self.triangles, axis, low + fraction * (high - low))
        if any(len(side) < MIN_TRIANGLES for side in sides):
            return 0.0, []
        halves = [_Part(side) for side in sides]
        if any(half.volume <= 0.0 for half in halves):
            return 0.0, []
        return self.volume - sum(half.volume for half in halves), halves


def cut_triangles(triangles: Array, axis: int, position: float) -> tuple[Array, Array]:
    """Triangles (T, 3, 3) below and above a plane across an axis; those it crosses are divided."""
    above = triangles[:, :, axis] > position
    count = above.sum(axis=1)
    parts: tuple[list[Array], list[Array]] = ([triangles[count == 0]], [triangles[count == 3]])
    for lone_above in (False, True):
        crossed = count == (1 if lone_above else 2)
        lone = np.argmax(above[crossed] == lone_above, axis=1)
        rows = np.arange(len(lone))
        a, b, c = (triangles[crossed][rows, (lone + i) % 3] for i in range(3))
        ab, ac = _crossing(a, b, axis, position), _crossing(a, c, axis, position)
        parts[lone_above].append(np.stack([a, ab, ac], axis=1))
        pair = [np.stack([ab, b, c], axis=1), np.stack([ab, c, ac], axis=1)]
        parts[not lone_above].extend(pair)
    return np.concatenate(parts[0]), np.concatenate(parts[1])


def _crossing(a: Array, b: Array, axis: int, position: float) -> Array:
    """Where the edges from `a` to `b` (E, 3) cross the plane."""
    share = (position - a[:, axis]) / (b[:, axis] - a[:, axis])
    return a + share[:, None] * (b - a)


def _distinct(points: Array) -> Array:
    """The points (P, 3) without repetitions, told apart by one number each, which is fast."""
    _, first = np.unique(points @ (1.0, np.sqrt(2.0), np.pi), return_index=True)
    return points[first]


def _hull_volume(points: Array) -> float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except QhullError:  # flat
        return 0.0
