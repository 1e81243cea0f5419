# SPDX-License-Identifier: Apache-2.0
"""From a signed distance field to a closed triangle mesh of a wanted size.

Surface nets on a regular grid, then quadric decimation (spends triangles where the surface is
curved), rounder triangles, and every vertex back on the exact surface.
"""

import numpy as np
import trimesh

from arms.relax import Faces, relax
from arms.sdf import Array, Field, gradient


def mesh_field(
    field: Field, low: Array, high: Array, cell: float, triangles: int, tries: int = 4
) -> trimesh.Trimesh:
    """The zero level of `field` inside the box `low`..`high` as about `triangles` triangles.

    Surface nets can pinch where a cell is crossed twice; then the cell is made smaller.

    Raises:
        ValueError: the result is not a closed, outward-oriented surface.
    """
    for attempt in range(tries):
        size = cell * 0.88**attempt
        vertices, faces = surface_nets(field, low, high, size)
        if not is_closed(vertices, faces):
            continue
        vertices, faces = decimate(project(field, vertices, 4 * size), faces, triangles)
        vertices, faces = relax(field, project(field, vertices, 2 * size), faces)
        vertices = project(field, vertices, 2 * size)
        vertices = vertices.astype(np.float32).astype(np.float64)  # what binary STL keeps
        if is_closed(vertices, faces) and steepest(field, vertices, faces) > 0.7:
            return trimesh.Trimesh(vertices, faces)
    raise ValueError("the mesh is not closed and sound; refine the cell or the shape")


def is_closed(vertices: Array, faces: Faces) -> bool:
    """Does every edge join two faces, all facing outwards?"""
    mesh = trimesh.Trimesh(vertices, faces)
    return bool(mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0)


def steepest(field: Field, vertices: Array, faces: Faces) -> float:
    """The least cosine between a triangle's normal and the surface's at its middle."""
    mesh = trimesh.Trimesh(vertices, faces)
    normals = gradient(field, mesh.triangles_center)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    return float((normals * mesh.face_normals).sum(axis=1).min())


def surface_nets(field: Field, low: Array, high: Array, cell: float) -> tuple[Array, Faces]:
    """Vertices (V, 3) and triangles (F, 3): one vertex per grid cell that the surface crosses."""
    counts = np.ceil((high - low) / cell).astype(int) + 1
    axes = [low[i] + cell * np.arange(counts[i]) for i in range(3)]
    values = sample(field, axes)
    vertices, index = _cell_vertices(values)
    return low + cell * vertices, _crossing_quads(values, index)


def sample(field: Field, axes: list[Array]) -> Array:
    """`field` on the grid spanned by three coordinate arrays, one slab at a time."""
    values = np.empty([len(axis) for axis in axes])
    y, z = np.meshgrid(axes[1], axes[2], indexing="ij")
    for i, x in enumerate(axes[0]):
        points = np.column_stack([np.full(y.size, x), y.ravel(), z.ravel()])
        values[i] = field(points).reshape(y.shape)
    return values


def _cell_vertices(values: Array) -> tuple[Array, Faces]:
    """Mean of the edge crossings of each crossed cell, in cells; and cell -> vertex number."""
    shape = np.array(values.shape) - 1
    total, count = np.zeros((*shape, 3)), np.zeros(shape)
    for axis in range(3):
        along = np.moveaxis(values, axis, 0)
        a, b = along[:-1], along[1:]
        crossed = (a < 0) != (b < 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            t = np.where(crossed, a / (a - b), 0.0)
        for u in (0, 1):
            for v in (0, 1):
                window = np.s_[:, u : crossed.shape[1] - 1 + u, v : crossed.shape[2] - 1 + v]
                hit = np.moveaxis(crossed[window], 0, axis)
                offset = [u, v]
                offset.insert(axis, 0)
                point = np.array(offset) + 0.0 * hit[..., None]
                point[..., axis] = np.moveaxis(t[window], 0, axis)
                total += np.where(hit[..., None], point, 0.0)
                count += hit
    used = count > 0
    index = np.full(shape, -1)
    index[used] = np.arange(used.sum())
    return np.argwhere(used) + total[used] / count[used][:, None], index


def _crossing_quads(values: Array, index: Faces) -> Faces:
    """Two triangles around every grid edge that the surface crosses, oriented outwards."""
    faces = []
    for axis in range(3):
        u, v = (axis + 1) % 3, (axis + 2) % 3
        a = np.take(values, range(values.shape[axis] - 1), axis)
        b = np.take(values, range(1, values.shape[axis]), axis)
        edges = np.argwhere((a < 0) != (b < 0))
        leaving = a[tuple(edges.T)] < 0
        ring = []
        for du, dv in ((-1, -1), (0, -1), (0, 0), (-1, 0)):
            cell = edges.copy()
            cell[:, u] += du
            cell[:, v] += dv
            ring.append(index[tuple(cell.T)])
        quad = np.column_stack(ring)
        quad[~leaving] = quad[~leaving][:, ::-1]
        faces += [quad[:, [0, 1, 2]], quad[:, [0, 2, 3]]]
    return np.vstack(faces)


def project(field: Field, vertices: Array, limit: float, steps: int = 6) -> Array:
    """Newton steps of `vertices` onto the zero level, none longer than `limit` in all."""
    result = vertices.copy()
    for _ in range(steps):
        normal = gradient(field, result)
        step = field(result)[:, None] * normal / np.maximum((normal**2).sum(1), 0.05)[:, None]
        result -= step
        moved = result - vertices
        length = np.linalg.norm(moved, axis=1, keepdims=True)
        result = vertices + moved * np.minimum(1.0, limit / np.maximum(length, 1e-12))
    return result


def decimate(vertices: Array, faces: Faces, triangles: int) -> tuple[Array, Faces]:
    """Quadric edge collapse to about `triangles` triangles (package fast-simplification)."""
    import fast_simplification

    points, cells = fast_simplification.simplify(
        vertices.astype(np.float32), faces.astype(np.int32), target_count=triangles, agg=3.0
    )
    return np.asarray(points, dtype=np.float64), np.asarray(cells)
