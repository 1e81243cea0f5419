# SPDX-License-Identifier: Apache-2.0
"""The surface of a link as triangles with outward normals: where contacts can be."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.arrays import Index
from touchline.model.mechanism import Array, Geometry, Link, Mechanism
from touchline.model.mesh_file import MeshError, Triangles, read_mesh
from touchline.model.tessellation import tessellate
from touchline.model.transforms import move_points

# A mesh in millimetres that is read in metres is 1000 times too large. No link is longer than this
# many times the whole robot, or than so many metres where the robot has no length of its own.
LARGEST_SHARE, LARGEST = 10.0, 5.0
SMALLEST_SHARE = 0.005  # of the robot's length, of the largest link


@dataclass(frozen=True)
class Surface:
    """Triangles of one link, in its frame [m].

    Attributes:
        vertices: (V, 3).
        faces: (F, 3) indices into `vertices`, counter-clockwise seen from outside.
        normals: (F, 3) outward unit normals.
        areas: (F,) [m2]; the weights for sampling points.
        closed: whether every shape of it is watertight, so that inside and outside are certain.
        warnings: what is doubtful about it.
    """

    vertices: Array
    faces: Index
    normals: Array
    areas: Array
    closed: bool
    warnings: tuple[str, ...] = ()


def link_surface(link: Link, kind: str = "collision") -> Surface | None:
    """Return the surface of a link from its `collision` or `visual` shapes.

    Where there are none of that kind it is made of the other kind.

    Returns:
        None if the link has no shapes or one of its meshes cannot be read.
    """
    try:
        return _surface(link, kind)
    except MeshError:
        return None


@dataclass(frozen=True)
class Surfaces:
    """The surfaces of a robot's links.

    Attributes:
        by_link: of each link that has one.
        lost: a line for each surface that cannot be used; no contact is located there.
        doubts: a line for each that is used although something is odd about it.
    """

    by_link: dict[str, Surface]
    lost: tuple[str, ...]
    doubts: tuple[str, ...]


def mechanism_surfaces(mechanism: Mechanism, kind: str = "collision") -> Surfaces:
    """Return the surface of each link that has one, and what is lost or doubtful."""
    found: dict[str, Surface] = {}
    lost: list[str] = []
    doubts: list[str] = []
    length = max(LARGEST_SHARE * chain_length(mechanism), LARGEST)
    for link in mechanism.links.values():
        try:
            surface = _surface(link, kind)
            if surface is not None and (size := _size(surface)) > length:
                raise MeshError(
                    f"its surface is {size:.3g} m long, on a robot of "
                    f"{chain_length(mechanism):.2g} m: a mesh in millimetres needs the scale 0.001"
                )
        except MeshError as error:
            if not any(shape.problem for shape in _shapes(link, kind)):  # else the reader told it
                lost.append(f"link '{link.name}': {error}; no contact is located on it")
            continue
        if surface is not None:
            found[link.name] = surface
            doubts += [f"link '{link.name}': {line}" for line in surface.warnings]
    largest = max((_size(surface) for surface in found.values()), default=np.inf)
    if largest < SMALLEST_SHARE * chain_length(mechanism):
        lost.append(
            f"the largest surface is {1e3 * largest:.3g} mm long, on a robot of "
            f"{chain_length(mechanism):.2g} m: no place on it can be right; is the scale of the "
            "meshes 0.001 too small?"
        )
    return Surfaces(found, tuple(lost), tuple(doubts))


def chain_length(mechanism: Mechanism) -> float:
    """Return the length of the longest chain of joints, from origin to origin [m]."""
    length = {mechanism.root: 0.0}
    waiting = list(mechanism.joints.values())
    while waiting:
        ready = [joint for joint in waiting if joint.parent in length]
        for joint in ready:
            step = float(np.linalg.norm(joint.T_parent_joint[:3, 3]))
            length[joint.child] = length[joint.parent] + step
        waiting = [joint for joint in waiting if joint.parent not in length]
        if not ready:
            break
    return max(length.values())


def _size(surface: Surface) -> float:
    """Return the diagonal of the box around a surface [m]."""
    return float(np.linalg.norm(np.ptp(surface.vertices, axis=0)))


def _surface(link: Link, kind: str) -> Surface | None:
    if kind not in ("collision", "visual"):
        raise ValueError(f"kind '{kind}' is not allowed; allowed: collision, visual")
    shapes = _shapes(link, kind)
    parts, warnings, offset = [], [], 0
    for shape in shapes:
        vertices, faces, doubts = _shape_triangles(shape)
        parts.append((vertices, faces + offset))
        warnings += doubts
        offset += len(vertices)
    if not parts:
        return None
    vertices, faces = (np.vstack(part) for part in zip(*parts, strict=True))
    normals, areas = _normals(vertices, faces)
    return Surface(vertices, faces, normals, areas, not warnings, tuple(warnings))


def _shapes(link: Link, kind: str) -> tuple[Geometry, ...]:
    return getattr(link, kind) or link.collision or link.visual


def _shape_triangles(shape: Geometry) -> tuple[Array, Index, list[str]]:
    """Return a shape's triangles in the link frame with outward faces, and what is doubtful."""
    vertices, faces = _own_triangles(shape)
    vertices, faces = _clean(vertices, faces)
    if len(faces) == 0:
        raise MeshError(f"{_name(shape)}: holds no triangle with an area")
    doubts = _doubts(faces)
    if _signed_volume(vertices, faces) < 0:  # mirrored by its scale, or exported inside out
        faces = faces[:, ::-1]
    vertices = move_points(vertices, shape.T_link_shape)
    return vertices, faces, [f"{_name(shape)}: {line}" for line in doubts]


def _own_triangles(shape: Geometry) -> Triangles:
    if shape.kind == "triangles" and shape.vertices is not None and shape.faces is not None:
        return shape.vertices, shape.faces
    if shape.kind != "mesh":
        return tessellate(shape)
    if shape.problem or shape.path is None:
        raise MeshError(shape.problem or "its mesh was not found")
    try:
        vertices, faces = read_mesh(Path(shape.path))
    except MeshError as error:
        raise MeshError(f"mesh '{shape.path}': {error}") from None
    return vertices * np.array(shape.scale), faces


def _name(shape: Geometry) -> str:
    return f"mesh '{shape.path}'" if shape.path else shape.kind


def _clean(vertices: Array, faces: Index) -> Triangles:
    """Merge equal vertices (an STL repeats them in each facet); drop faces without an area."""
    step = max(1e-7 * float(np.ptp(vertices, axis=0).max(initial=0.0)), 1e-12)
    first, merged = _distinct(np.round(vertices / step).astype(np.int64))
    faces = merged[faces]
    a, b, c = faces.T
    return vertices[first], faces[(a != b) & (b != c) & (c != a)]


def _distinct(rows: Index) -> tuple[Index, Index]:
    """Return where each distinct row (V, 3) first stands, and which of them each row is.

    As `np.unique` along an axis, several times faster.
    """
    order = np.lexsort(rows.T[::-1])
    new = np.append(True, (np.diff(rows[order], axis=0) != 0).any(axis=1))[: len(rows)]
    merged = np.empty(len(rows), np.int64)
    merged[order] = np.cumsum(new) - 1
    return order[new], merged


def _doubts(faces: Index) -> list[str]:
    """Say what keeps the faces from being one closed, consistently turned surface.

    Closed: each edge belongs to two faces. Consistent: they run along it in opposite directions.
    """
    edges = np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    one = np.array([int(faces.max(initial=0)) + 1, 1])  # makes one number of an edge
    _, used = np.unique(np.sort(edges, axis=1) @ one, return_counts=True)
    if (used % 2 == 1).any():
        open_edges = int((used % 2 == 1).sum())
        return [f"is not closed ({open_edges} open edges); a line may pass through it unnoticed"]
    forward, there = np.unique(edges @ one, return_counts=True)
    backward, back = np.unique(edges[:, ::-1] @ one, return_counts=True)
    if len(forward) != len(backward) or (forward != backward).any() or (there != back).any():
        return ["its faces are not turned the same way; some normals point inwards"]
    return []


def _signed_volume(vertices: Array, faces: Index) -> float:
    """Return the volume by the divergence theorem; negative if the faces look inwards.

    About the middle of the vertices, so that it also tells the side of a surface with holes.
    """
    a, b, c = (vertices - vertices.mean(axis=0))[faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def _normals(vertices: Array, faces: Index) -> tuple[Array, Array]:
    a, b, c = vertices[faces].transpose(1, 0, 2)
    cross = np.cross(b - a, c - a)
    length = np.linalg.norm(cross, axis=1)
    # A sliver's normal is uncertain but must stay finite; its area gives it no weight.
    return cross / np.maximum(length, 1e-300)[:, None], length / 2
