# SPDX-License-Identifier: Apache-2.0
"""Makes the triangles of a decimated mesh rounder without leaving the surface.

Quadric decimation leaves long slivers on cylinders, which shade badly and have poor normals. Two
moves mend them: flipping edges that are not Delaunay, and sliding vertices within the surface.
"""

import numpy as np
from numpy.typing import NDArray

from arms.sdf import Array, Field, gradient

Faces = NDArray[np.int64]
SLACK = 6e-5  # how far a flipped edge may leave the surface [m]


def relax(field: Field, vertices: Array, faces: Faces, passes: int = 12) -> tuple[Array, Faces]:
    """`vertices` (V, 3) and `faces` (F, 3) with better shaped triangles of the same count."""
    for _ in range(passes):
        for _ in range(4):
            faces, flips = _flip(field, vertices, faces)
            if flips == 0:
                break
        vertices = _slide(field, vertices, faces)
    return vertices, faces


def _flip(field: Field, vertices: Array, faces: Faces) -> tuple[Faces, int]:
    """Flips an independent set of edges whose opposite angles add up to more than pi."""
    pairs, left, right = _interior_edges(faces)
    a, b = pairs.T
    c, d = _opposite(faces[left], a, b), _opposite(faces[right], a, b)
    angles = _angle(vertices, c, a, b) + _angle(vertices, d, a, b)
    wanted = np.flatnonzero(angles > np.pi + 0.05)
    wanted = wanted[_stays_on_surface(field, vertices, *(n[wanted] for n in (a, b, c, d)))]
    existing = {tuple(pair) for pair in pairs.tolist()}
    touched, count, result = set(), 0, faces.copy()
    for i in wanted[np.argsort(-angles[wanted], kind="stable")]:
        ring = {int(n) for n in (a[i], b[i], c[i], d[i])}
        new = (int(min(c[i], d[i])), int(max(c[i], d[i])))
        if ring & touched or new in existing:
            continue
        touched |= ring
        result[left[i]], result[right[i]] = _turned(
            faces[left[i]], int(a[i]), int(b[i]), int(c[i]), int(d[i])
        )
        count += 1
    return result, count


def _interior_edges(faces: Faces) -> tuple[Faces, Faces, Faces]:
    """Every edge once as (E, 2) sorted vertex numbers, with its two faces."""
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    owner = np.repeat(np.arange(len(faces)), 3)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    return edges[order[::2]], owner[order[::2]], owner[order[1::2]]


def _opposite(faces: Faces, a: Faces, b: Faces) -> Faces:
    """The corner of each face that is neither `a` nor `b`."""
    return faces.sum(axis=1) - a - b


def _angle(vertices: Array, at: Faces, a: Faces, b: Faces) -> Array:
    u, v = vertices[a] - vertices[at], vertices[b] - vertices[at]
    return np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), (u * v).sum(axis=1))


def _stays_on_surface(
    field: Field, vertices: Array, a: Faces, b: Faces, c: Faces, d: Faces
) -> NDArray[np.bool_]:
    """Is edge c-d no worse an approximation than a-b, and are both new triangles face up?"""
    old = np.abs(field((vertices[a] + vertices[b]) / 2))
    middle = (vertices[c] + vertices[d]) / 2
    good = np.abs(field(middle)) < np.maximum(1.05 * old, SLACK)
    up = gradient(field, middle)
    sides = []
    for corner in (a, b):
        normal = np.cross(vertices[c] - vertices[corner], vertices[d] - vertices[corner])
        sides.append((normal * up).sum(axis=1) / np.linalg.norm(normal, axis=1))
    return good & (sides[0] * sides[1] < 0) & (np.minimum(*np.abs(sides)) > 0.7)


def _turned(face: Faces, a: int, b: int, c: int, d: int) -> tuple[list[int], list[int]]:
    """The two triangles of the quad a-b-c-d after the flip, oriented like `face` = (a, b, c)."""
    forward = (list(face).index(b) - list(face).index(a)) % 3 == 1
    return ([a, d, c], [d, b, c]) if forward else ([d, a, c], [b, d, c])


def _slide(field: Field, vertices: Array, faces: Faces, share: float = 0.35) -> Array:
    """Moves each vertex in its tangent plane to the middle of its neighbours where it is flat.

    Along a fillet the neighbourhood is curved across and flat along; the move is scaled down by how
    far the normals of the neighbours differ, so that fillets keep their vertices.
    """
    pairs, _, _ = _interior_edges(faces)
    both = np.vstack([pairs, pairs[:, ::-1]])
    normals = gradient(field, vertices)
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-9)
    agree = np.ones(len(vertices))
    np.minimum.at(agree, both[:, 0], (normals[both[:, 0]] * normals[both[:, 1]]).sum(axis=1))
    centre = np.zeros_like(vertices)
    np.add.at(centre, both[:, 0], vertices[both[:, 1]])
    centre /= np.bincount(both[:, 0], minlength=len(vertices))[:, None]
    move = centre - vertices
    move -= (move * normals).sum(axis=1, keepdims=True) * normals
    weight = share * np.clip((agree - 0.80) / 0.15, 0.0, 1.0)
    moved = vertices + weight[:, None] * move
    return _undo_folds(normals, vertices, moved, faces)


def _undo_folds(normals: Array, before: Array, after: Array, faces: Faces) -> Array:
    """`after`, but with the corners of triangles that came to lie across the surface put back."""
    corners = after[faces]
    face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    face /= np.maximum(np.linalg.norm(face, axis=1, keepdims=True), 1e-15)
    up = normals[faces].mean(axis=1)
    folded = faces[(face * up).sum(axis=1) < 0.75]
    result = after.copy()
    result[folded] = before[folded]
    return result
