# SPDX-License-Identifier: Apache-2.0
"""Mesh files: a quick look at load time, and the triangles when a surface is needed."""

from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Index
from touchline.model.mechanism import Array

FORMATS = (".stl", ".obj", ".dae", ".ply", ".off", ".glb")
STL_HEADER, STL_FACET = 84, 50  # bytes of a binary STL
NEED_COLLADA = "a .dae file needs the package pycollada: pip install 'touchline[meshes]'"
NEED_TRIMESH = "a {} file needs the package trimesh: pip install 'touchline[meshes]'"

_FACET = np.dtype([("normal", "<f4", 3), ("vertices", "<f4", (3, 3)), ("attribute", "<u2")])

Triangles = tuple[Array, Index]


class MeshError(ValueError):
    """A mesh file cannot be used; the message says why, without the file's name."""


def mesh_problem(path: Path) -> str | None:
    """Say why a mesh file certainly cannot be read, from its name, size and first bytes.

    None is no promise: `read_mesh` has the last word. A whole arm takes about a millisecond.
    """
    suffix = path.suffix.lower()
    if suffix not in FORMATS:
        return f"unknown mesh format '{suffix}'; allowed: {', '.join(FORMATS)}"
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            start = file.read(4096)
    except OSError as error:
        return f"cannot be read: {error.strerror}"
    if size == 0:
        return "the file is empty"
    if suffix == ".stl":
        return _stl_problem(start, size)
    if find_spec("trimesh") is None:
        return NEED_TRIMESH.format(suffix)
    if suffix == ".dae":
        if b"<COLLADA" not in start:
            return "no COLLADA document"
        return None if find_spec("collada") else NEED_COLLADA
    return None


def _stl_problem(start: bytes, size: int) -> str | None:
    if start.lstrip()[:5].lower() == b"solid" and b"facet" in start.lower():
        return None
    if size < STL_HEADER:
        return f"too short for an STL file: {size} bytes"
    facets = int.from_bytes(start[80:84], "little")
    needed = STL_HEADER + STL_FACET * facets
    if facets == 0 or size < needed:
        return f"truncated STL file: {facets} facets need {needed} bytes, there are {size}"
    return None


def read_mesh(path: Path) -> Triangles:
    """Return vertices (V, 3) in metres and faces (F, 3) of a mesh file.

    The nodes of a COLLADA or glTF scene are put in place; COLLADA's `unit` is applied and its
    `up_axis` is not, as RViz does it.

    Raises:
        MeshError: the file cannot be read or holds no triangle.
    """
    problem = mesh_problem(path)
    if problem:
        raise MeshError(problem)
    if path.suffix.lower() == ".stl":
        return _finite(*_read_stl(path))
    import trimesh

    options: dict[str, Any] = {"skip_materials": True} if path.suffix.lower() == ".obj" else {}
    try:
        mesh = trimesh.load(path, force="mesh", process=False, **options)
        vertices, faces = np.array(mesh.vertices, float), np.array(mesh.faces, np.int64)  # type: ignore[union-attr]
    except Exception as error:  # trimesh and its parsers raise anything on a broken file
        raise MeshError(f"cannot be read: {error or type(error).__name__}") from None
    return _finite(vertices * _unit(path), faces)


def _finite(vertices: Array, faces: Index) -> Triangles:
    if len(faces) == 0:
        raise MeshError("holds no triangle")
    if not np.isfinite(vertices).all():
        raise MeshError("holds vertices that are not finite")
    return vertices, faces


def _read_stl(path: Path) -> Triangles:
    """Return the facets of a binary or an ASCII STL, each with vertices of its own."""
    data = path.read_bytes()
    if data.lstrip()[:5].lower() == b"solid" and b"facet" in data[:4096].lower():
        words = data.lower().split()
        places = [i for i, word in enumerate(words) if word == b"vertex"]
        try:
            numbers = [[float(x) for x in words[i + 1 : i + 4]] for i in places]
            vertices = np.array(numbers, float).reshape(-1, 3)
        except ValueError:
            raise MeshError("cannot be read: a vertex is not three numbers") from None
        if len(vertices) % 3:
            raise MeshError("cannot be read: a facet has not three vertices")
    else:
        count = int.from_bytes(data[80:84], "little")
        facets = np.frombuffer(data, _FACET, count, STL_HEADER)
        with np.errstate(invalid="ignore"):  # numbers that are none are refused below
            vertices = facets["vertices"].astype(float).reshape(-1, 3)
    return vertices, np.arange(len(vertices)).reshape(-1, 3)


def _unit(path: Path) -> float:
    """Return the metres of a COLLADA file's unit; 1 for every other format."""
    if path.suffix.lower() != ".dae":
        return 1.0
    from xml.etree import ElementTree

    for _, element in ElementTree.iterparse(path):
        if element.tag.endswith("}unit"):
            return float(element.get("meter", "1"))
        if element.tag.endswith("}asset"):
            break
    return 1.0
