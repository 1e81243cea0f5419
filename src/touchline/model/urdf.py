# SPDX-License-Identifier: Apache-2.0
"""A thin URDF reader: tree, inertias, limits, mimic and shapes, as written.

Reference: http://wiki.ros.org/urdf/XML. Materials, transmissions, sensors and the like are skipped.
"""

import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import replace
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest import mock
from xml.etree.ElementTree import Element

import numpy as np

from touchline.errors import InputError
from touchline.model.mechanism import Array, Joint, Link, Mechanism, Mimic
from touchline.model.packages import package_folder
from touchline.model.plausibility import mechanism_warnings
from touchline.model.topology import find_root, resolve_mimics
from touchline.model.urdf_elements import Reader, named
from touchline.model.yaml_file import read_bytes
from touchline.suggest import did_you_mean

KINDS = {name: name for name in ("revolute", "prismatic", "fixed")} | {"continuous": "revolute"}
UNMOVED = ("fixed", "floating")  # no axis
STANDING = "a robot must stand on the world; make it fixed, or split it into single joints"
STANDARD_GRAVITY = (0.0, 0.0, -9.81)  # of the contract; a URDF has no gravity


def load_urdf(path: Path | str, package_dirs: Sequence[Path] = ()) -> Mechanism:
    """Read a URDF; its world is the root link's frame.

    Args:
        path: the file.
        package_dirs: folders in which `package://NAME/x` is NAME/x or x.

    Raises:
        InputError: what is wrong with the file, all of it at once. A mesh that cannot be found is
            a warning of the mechanism.
    """
    path = Path(path)
    robot = parse_xml(path, package_dirs)
    reader = Reader(path, package_dirs)
    if robot.tag != "robot":
        raise InputError(f"{path}: the root element is <{robot.tag}>; a URDF's is <robot>")
    if any("xacro" in element.tag for element in robot.iter()):
        raise InputError(f"{path}: holds xacro macros; name the file .xacro, and they are expanded")
    links = {
        name: _link(reader, name, element)
        for name, element in named(robot.findall("link"), "link", reader.fault)
    }
    joints = {}
    for name, element in named(robot.findall("joint"), "joint", reader.fault):
        joint = _joint(reader, name, element, links)
        joints |= {name: joint} if joint else {}
    return _mechanism(reader, robot, links, joints)


def parse_xml(path: Path, package_dirs: Sequence[Path] = ()) -> Element:
    """Return the root element of an XML file; a `.xacro` is expanded by the package xacro.

    Args:
        path: the file.
        package_dirs: folders in which `$(find NAME)` of a xacro is NAME.

    Raises:
        InputError: the file cannot be read, or line and column of the first error in it.
    """
    text = read_bytes(path)
    try:
        return ElementTree.fromstring(
            _expanded(path, package_dirs) if path.suffix == ".xacro" else text
        )
    except ElementTree.ParseError as error:
        line, column = error.position
        what = str(error).split(":")[0]
        raise InputError(f"{path}:{line}:{column + 1}: not well-formed XML: {what}") from None


def _expanded(path: Path, package_dirs: Sequence[Path]) -> str:
    try:
        xacro: Any = import_module("xacro")
    except ModuleNotFoundError:
        raise InputError(f"{path}: a xacro needs the package xacro: pip install xacro") from None
    # xacro asks ROS for packages; here they are found without it.
    index, packages = ModuleType("ament_index_python"), ModuleType("ament_index_python.packages")
    vars(packages)["get_package_share_directory"] = lambda package: str(
        package_folder(package, path.parent, package_dirs)
    )
    vars(index)["packages"] = packages
    try:
        with mock.patch.dict(sys.modules, {index.__name__: index, packages.__name__: packages}):
            return xacro.process_file(str(path)).toxml()
    except Exception as error:  # the package raises many kinds
        what = " ".join(str(error).split())
        raise InputError(f"{path}: xacro cannot expand it: {what}") from None


def _mechanism(
    reader: Reader, robot: Element, links: dict[str, Link], joints: dict[str, Joint]
) -> Mechanism:
    root, floating = "", None
    if not links:
        reader.problems.append(f"{reader.path}: no <link> in it")
    elif not reader.problems:
        # A joint or link that could not be read would make the tree look broken.
        root = find_root(links, joints, reader.fault)
        joints, floating = _standing(reader, joints, root)
        joints = resolve_mimics(joints, reader.fault)
    if reader.problems:
        raise InputError(reader.problems)
    name = robot.get("name") or reader.path.stem
    gravity = np.array(STANDARD_GRAVITY)
    mechanism = Mechanism(name, root, links, joints, gravity, floating=floating)
    return mechanism_warnings(mechanism, reader.path)


def _standing(
    reader: Reader, joints: dict[str, Joint], root: str
) -> tuple[dict[str, Joint], str | None]:
    """The joints with a floating one on the root fixed, and the link that it carries."""
    floating = None
    for name, joint in joints.items():
        if joint.kind == "floating" and joint.parent == root and floating is None:
            floating = joint.child
            joints = joints | {name: replace(joint, kind="fixed")}
        elif joint.kind == "floating":
            reader.fault(f"joint '{name}'", f"type 'floating' is not supported: {STANDING}")
    return joints, floating


def _link(reader: Reader, name: str, element: Element) -> Link:
    where = f"link '{name}'"
    return Link(
        name,
        reader.inertial(element, where),
        reader.geometries(element, "collision", where),
        reader.geometries(element, "visual", where),
    )


def _joint(reader: Reader, name: str, element: Element, links: dict[str, Link]) -> Joint | None:
    where = f"joint '{name}'"
    kind = _kind(reader, element, where)
    parent, child = (_end(reader, element, end, links, where) for end in ("parent", "child"))
    T = reader.origin(element, where)
    axis = _axis(reader, element, where) if kind not in UNMOVED else np.array([0.0, 0.0, 1.0])
    lower, upper, velocity, effort = _limits(reader, element, where)
    mimic = _mimic(reader, element, where) if kind != "fixed" else None
    if not (kind and parent and child):
        return None
    return Joint(name, kind, parent, child, T, axis, lower, upper, velocity, effort, mimic)


def _kind(reader: Reader, element: Element, where: str) -> str | None:
    kind = element.get("type", "")
    if kind in KINDS:
        return KINDS[kind]
    if kind == "floating":
        return kind
    if kind == "planar":
        reader.fault(where, f"type '{kind}' is not supported: {STANDING}")
    else:
        allowed = list(KINDS)
        what = f"type '{kind}' is not allowed; allowed: {', '.join(allowed)}"
        reader.fault(where, what + did_you_mean(kind, allowed))
    return None


def _end(
    reader: Reader, element: Element, end: str, links: dict[str, Link], where: str
) -> str | None:
    child = element.find(end)
    link = child.get("link") if child is not None else None
    if link is None:
        reader.fault(where, f"has no <{end} link='...'>")
    elif link not in links:
        reader.fault(where, f"{end} link '{link}' does not exist" + did_you_mean(link, links))
        return None
    return link


def _axis(reader: Reader, element: Element, where: str) -> Array:
    child = element.find("axis")
    values = [1.0, 0.0, 0.0]  # URDF's default
    if child is not None:
        values = reader.numbers(child, "xyz", 3, where) or values
    length = float(np.linalg.norm(values))
    if length < 1e-9:
        reader.fault(where, "the axis is zero")
        return np.array([1.0, 0.0, 0.0])
    return np.array(values) / length


def _limits(reader: Reader, element: Element, where: str) -> tuple[float, float, float, float]:
    child = element.find("limit")
    if child is None:
        return -np.inf, np.inf, np.inf, np.inf
    velocity = reader.number(child, "velocity", where, np.inf)
    effort = reader.number(child, "effort", where, np.inf)
    if element.get("type") == "continuous":
        return -np.inf, np.inf, velocity, effort
    # URDF: a bound that is not given is 0, but `lower = upper` would lock the joint.
    bounded = "lower" in child.attrib or "upper" in child.attrib
    lower = reader.number(child, "lower", where, 0.0 if bounded else -np.inf)
    upper = reader.number(child, "upper", where, 0.0 if bounded else np.inf)
    if lower > upper:
        reader.fault(where, f"lower limit {lower:g} is above the upper limit {upper:g}")
    return lower, upper, velocity, effort


def _mimic(reader: Reader, element: Element, where: str) -> Mimic | None:
    child = element.find("mimic")
    if child is None:
        return None
    joint = child.get("joint")
    if not joint:
        reader.fault(where, "<mimic> has no 'joint'")
        return None
    multiplier = reader.number(child, "multiplier", where, 1.0)
    return Mimic(joint, multiplier, reader.number(child, "offset", where, 0.0))
