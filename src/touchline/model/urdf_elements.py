# SPDX-License-Identifier: Apache-2.0
"""The elements of a URDF that hold numbers: origins, inertials, limits, shapes."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np

from touchline.model.mechanism import Array, Geometry, Inertia
from touchline.model.mesh_file import mesh_problem
from touchline.model.packages import FileMissingError, PackageMissingError, resolve
from touchline.model.transforms import inertia_matrix, move_inertia, pose_rpy

PRIMITIVES = {"box": ("size",), "sphere": ("radius",)}
PRIMITIVES |= dict.fromkeys(("cylinder", "capsule"), ("radius", "length"))


@dataclass
class Reader:
    """Reads elements of one file; what is wrong goes to `problems`, and reading goes on.

    Attributes:
        path: the URDF.
        package_dirs: where `package://` is looked up.
        problems: errors so far.
    """

    path: Path
    package_dirs: Sequence[Path] = ()
    problems: list[str] = field(default_factory=list)

    def fault(self, where: str, what: str) -> None:
        """Note an error at an element of the file."""
        self.problems.append(f"{self.path}: {where}: {what}")

    def numbers(self, element: Element, key: str, count: int, where: str) -> list[float] | None:
        """Return `count` finite numbers of an attribute, or None after noting what is wrong."""
        text = element.get(key)
        if text is None:
            self.fault(where, f"<{element.tag}> has no '{key}'")
            return None
        try:
            values = [float(word) for word in text.split()]
        except ValueError:
            values = []
        if len(values) == count and all(map(math.isfinite, values)):
            return values
        hint = " (run xacro on the file first)" if "${" in text else ""
        wanted = "a finite number" if count == 1 else f"{count} finite numbers"
        self.fault(where, f"<{element.tag} {key}='{text}'> is not {wanted}{hint}")
        return None

    def number(self, element: Element, key: str, where: str, default: float) -> float:
        """Return one finite number; `default` without the attribute or after noting an error."""
        if key not in element.attrib:
            return default
        values = self.numbers(element, key, 1, where)
        return values[0] if values else default

    def origin(self, element: Element, where: str) -> Array:
        """Return the pose (4, 4) of the `origin` child; identity without one."""
        child = element.find("origin")
        if child is None:
            return np.eye(4)
        parts = (
            self.numbers(child, key, 3, where) if key in child.attrib else None
            for key in ("xyz", "rpy")
        )
        xyz, rpy = (part or [0.0, 0.0, 0.0] for part in parts)
        return pose_rpy(xyz, rpy)

    def inertial(self, link: Element, where: str) -> Inertia:
        """Return the link's inertia turned into the link's axes; none of it without `inertial`."""
        element = link.find("inertial")
        if element is None:
            return Inertia.zero()
        mass, matrix = element.find("mass"), element.find("inertia")
        if mass is None or matrix is None:
            missing = "mass" if mass is None else "inertia"
            self.fault(where, f"<inertial> has no <{missing}>")
            return Inertia.zero()
        value = self.numbers(mass, "value", 1, where)
        if value and value[0] < 0:
            self.fault(where, f"mass {value[0]:g} kg is negative")
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        six = [self.number(matrix, key, where, 0.0) for key in keys]
        body = Inertia(value[0] if value else 0.0, np.zeros(3), inertia_matrix(six))
        return move_inertia(body, self.origin(element, where))

    def geometries(self, link: Element, tag: str, where: str) -> tuple[Geometry, ...]:
        """Return the shapes of all `visual` or `collision` children."""
        found = (self._geometry(element, where) for element in link.findall(tag))
        return tuple(shape for shape in found if shape is not None)

    def _geometry(self, element: Element, where: str) -> Geometry | None:
        holder = element.find("geometry")
        shape = next(iter(holder), None) if holder is not None else None
        if shape is None:
            self.fault(where, f"<{element.tag}> has no shape in a <geometry>")
            return None
        T = self.origin(element, where)
        if shape.tag == "mesh":
            return self._mesh(shape, T, where)
        if shape.tag in PRIMITIVES:
            return self._primitive(shape, T, where)
        allowed = ", ".join(["mesh", *PRIMITIVES])
        self.fault(where, f"unknown shape <{shape.tag}>; allowed: {allowed}")
        return None

    def _primitive(self, shape: Element, T: Array, where: str) -> Geometry | None:
        size: list[float] = []
        for key in PRIMITIVES[shape.tag]:
            size += self.numbers(shape, key, 3 if key == "size" else 1, where) or []
        if any(value < 0 for value in size):
            self.fault(where, f"<{shape.tag}> has a negative size")
        return Geometry(shape.tag, T, tuple(size))

    def _mesh(self, shape: Element, T: Array, where: str) -> Geometry | None:
        uri = shape.get("filename")
        if not uri:
            self.fault(where, "<mesh> has no 'filename'")
            return None
        scale = self.numbers(shape, "scale", 3, where) if "scale" in shape.attrib else None
        x, y, z = scale or (1.0, 1.0, 1.0)
        return replace(self._mesh_file(uri, T), scale=(x, y, z))

    def _mesh_file(self, uri: str, T: Array) -> Geometry:
        """The mesh of a file, with why it cannot be used, if so."""
        try:
            path = resolve(uri, self.path.parent, self.package_dirs)
        except PackageMissingError as error:  # one reason for many meshes
            return Geometry("mesh", T, problem=str(error))
        except FileNotFoundError as error:
            folder = error.folder if isinstance(error, FileMissingError) else None
            return Geometry("mesh", T, problem=f"mesh '{uri}': {error}", missing_in=folder)
        problem = mesh_problem(path)
        told = f"mesh '{uri}': {problem}" if problem else None
        return Geometry("mesh", T, path=str(path), problem=told)


def named(elements: list[Element], kind: str, fault: Callable[[str, str], None]) -> Iterator:
    """Yield (name, element) for each element with a name of its own; note those without."""
    seen: set[str] = set()
    for index, element in enumerate(elements):
        name = element.get("name", "").strip()
        if not name:
            fault(f"{kind} number {index + 1}", "has no name")
        elif name in seen:
            fault(f"{kind} '{name}'", "the name stands twice")
        else:
            seen.add(name)
            yield name, element
