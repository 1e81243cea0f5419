# SPDX-License-Identifier: Apache-2.0
"""Do the names in a `robot.yaml` exist, once, where they are used?

Each check yields (place, what is wrong). Names are taken from the data as they stand in the file,
so that an item with another error does not make those that refer to it look wrong.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from touchline.model.entries import JointEntry, RobotFile, SensorEntry
from touchline.model.mechanism import Mechanism
from touchline.model.topology import independent_joints, outboard_links
from touchline.suggest import FEW, listing, unknown

Problem = tuple[str, str]
RESERVED = ("root",)  # the name of a segment
# Keys and columns that stand beside the names of the sensors.
RESERVED_SENSORS = (*RESERVED, "joints", "q", "qd", "tau", "tau_ext", "time", "health", "truth")


@dataclass(frozen=True)
class Names:
    """The names in the file: of observed joints (None: not listed), locked ones and sensors."""

    joints: list[str] | None
    locked: list[str]
    sensors: list[str]


def names_in(data: dict[Any, Any]) -> Names:
    """Return every name that stands in the raw data, readable item or not."""
    joints, locked = data.get("joints"), data.get("locked")
    locked = list(locked) if isinstance(locked, dict) else locked
    return Names(
        None if joints is None else _names(joints),
        _names(locked),
        _names(data.get("force_torque_sensors")),
    )


def _names(items: Any) -> list[str]:
    items = items if isinstance(items, list) else []
    found = [item.get("name") if isinstance(item, dict) else item for item in items]
    return [name for name in found if isinstance(name, str)]


def check_names(file: RobotFile, names: Names, mechanism: Mechanism | None) -> Iterator[Problem]:
    """Yield what is wrong with the names; those of links and joints only with a mechanism."""
    yield from _unique_names(file)
    yield from _sources(file, names)
    if mechanism is None:
        return
    yield from _joint_names(file, mechanism)
    yield from _locked_names(file, names, mechanism)
    yield from _link_names(file, mechanism)
    yield from _source_positions(file, mechanism)


def numbered(items: list[Any] | None, key: str) -> Iterator[tuple[str, Any]]:
    """Yield (place, item) for the readable items of a list."""
    for index, item in enumerate(items or ()):
        if item is not None:
            yield f"{key}[{index}]", item


def joint_entries(file: RobotFile) -> Iterator[tuple[str, JointEntry]]:
    """Yield (place, joint) for the readable joints."""
    return numbered(file.joints, "joints")


def sensor_entries(file: RobotFile) -> Iterator[tuple[str, SensorEntry]]:
    """Yield (place, sensor) for the readable sensors."""
    return numbered(file.force_torque_sensors, "force_torque_sensors")


def _unique_names(file: RobotFile) -> Iterator[Problem]:
    first: dict[str, str] = {}
    dotted: dict[str, str] = {}  # name -> where it stands
    entries = [(*entry, RESERVED) for entry in joint_entries(file)]
    entries += [(*entry, RESERVED_SENSORS) for entry in sensor_entries(file)]
    for place, item, reserved in entries:
        where, name = f"{place}.name", item.name
        if name is None:
            continue
        if name in first:
            what = "names are unique across joints and sensors"
            yield where, f"'{name}' is also the name of {first[name]}; {what}"
        first.setdefault(name, place)
        if name in reserved:
            yield where, f"'{name}' is reserved; reserved names: {', '.join(reserved)}"
        if "." in name:
            dotted[f"'{name}'"] = where
    if dotted:
        names = listing(dotted, FEW)
        what = f"{names} has a dot" if len(dotted) == 1 else f"{len(dotted)} have a dot: {names}"
        yield next(iter(dotted.values())), f"{what}; dots are reserved"


def _sources(file: RobotFile, names: Names) -> Iterator[Problem]:
    for place, joint in joint_entries(file):
        for source in joint.torque.sources:
            if source not in names.sensors:
                yield f"{place}.torque.from", unknown(source, "sensor", names.sensors)
        if joint.rotor_inertia and joint.torque.kind != "motor":
            what = f"{joint.rotor_inertia:g} is given, but only a joint with torque: motor has one"
            yield f"{place}.rotor_inertia", what
        if joint.friction.stribeck and not joint.friction.stribeck_speed:
            what = f"{joint.friction.stribeck:g} is given without stribeck_speed"
            yield f"{place}.friction.stribeck", what


def _joint_names(file: RobotFile, mechanism: Mechanism) -> Iterator[Problem]:
    for place, joint in joint_entries(file):
        problem = _not_independent(joint.name, mechanism) if joint.name else None
        if problem:
            yield f"{place}.name", problem
    if file.joints is None:
        for name in independent_joints(mechanism):
            if name not in file.locked and ("." in name or name in RESERVED):
                yield "joints", f"the model's joint '{name}' has a reserved name or a dot in it"


def _not_independent(name: str, mechanism: Mechanism) -> str | None:
    joint = mechanism.joints.get(name)
    if joint is None:
        return unknown(name, "joint", independent_joints(mechanism))
    if joint.kind == "fixed":
        return f"joint '{name}' is fixed in the model"
    if joint.mimic is not None:
        return f"joint '{name}' follows '{joint.mimic.joint}' (mimic) and is not named here"
    return None


def _locked_names(file: RobotFile, names: Names, mechanism: Mechanism) -> Iterator[Problem]:
    for name in file.locked:
        problem = _not_independent(name, mechanism)
        if problem:
            yield f"locked.{name}", problem
        elif name in (names.joints or ()):
            yield f"locked.{name}", "stands in joints too; a joint is either observed or locked"
    if names.joints is None:
        return
    named = (*names.joints, *names.locked)
    left = [name for name in independent_joints(mechanism) if name not in named]
    if left:
        example = ", ".join(f"{name}: 0.0" for name in left)
        what = f"in neither joints nor locked; hold with locked: {{{example}}}"
        yield "joints", f"the model's movable joints {', '.join(left)} are {what}"


def _link_names(file: RobotFile, mechanism: Mechanism) -> Iterator[Problem]:
    links = mechanism.links
    used = [(f"{place}.link", sensor.link) for place, sensor in sensor_entries(file)]
    used += [(f"{place}.link", load.link) for place, load in numbered(file.loads, "loads")]
    used += [(f"links.{name}", name) for name in file.links]
    used += list(numbered(file.graspable, "graspable"))
    used += list(numbered(file.pushes.links, "pushes.links"))
    for place, link in used:
        if link is not None and link not in links:
            yield place, unknown(link, "link", links)
    frames = ("sensor", "world", *links)
    for place, sensor in sensor_entries(file):
        if sensor.frame not in frames:
            yield f"{place}.frame", unknown(sensor.frame, "frame", frames)


def _source_positions(file: RobotFile, mechanism: Mechanism) -> Iterator[Problem]:
    """A torque is read from sensors on the joint's own branch, inboard or outboard of it."""
    sensors = {sensor.name: sensor for _, sensor in sensor_entries(file)}
    for place, joint in joint_entries(file):
        if joint.name not in mechanism.joints:
            continue
        child = mechanism.joints[joint.name].child
        outboard = outboard_links(mechanism, child, lambda _: True)
        for source in joint.torque.sources:
            link = sensors[source].link if source in sensors else None
            if link not in mechanism.links or link in outboard:
                continue
            if child not in outboard_links(mechanism, str(link), lambda _: True):
                what = f"sensor '{source}' on link '{link}' is on another branch than the joint"
                yield f"{place}.torque.from", what
