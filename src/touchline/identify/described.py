# SPDX-License-Identifier: Apache-2.0
"""What was identified, in the words of `robot.yaml`."""

from dataclasses import replace
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.identify.fit import Solution, link_vector, main_links
from touchline.identify.identification import Identification
from touchline.identify.payload import payload_link
from touchline.identify.regressor import body_of_vector
from touchline.model.corrections import corrected_inertia, load_inertia
from touchline.model.description import (
    Friction,
    JointDescription,
    LinkCorrection,
    Load,
    RobotDescription,
    SensorDescription,
)
from touchline.model.mechanism import Link
from touchline.model.robot import Robot
from touchline.model.transforms import combine_inertias, move_inertia
from touchline.model.tree import invert

UNCHANGED = 1e-3  # steps of `PhysicalBody` below it: no data told anything of the link
SMALLEST = 1e-9  # in SI units; smaller figures are rounding errors
DIGITS = 6  # of a written figure


def identified_robot(found: Identification) -> Robot:
    """The robot with all that was identified."""
    robot, solution = found.evidence.robot, found.solution
    description = robot.description
    joints = tuple(_joint(joint, j, solution) for j, joint in enumerate(description.joints))
    first = len(joints)
    sensors = tuple(
        _sensor(sensor, first + 6 * s, solution) for s, sensor in enumerate(description.sensors)
    )
    corrections = link_corrections(robot, solution)
    links = dict(description.links) | corrections
    loads = (*description.loads, *added_loads(robot, solution))
    changed = replace(description, joints=joints, sensors=sensors, links=links, loads=loads)
    mechanism = robot.mechanism
    bodies = {
        name: _changed(robot, changed, name)
        for name in {*corrections, *(load.link for load in loads)}
    }
    return Robot(changed, replace(mechanism, links=mechanism.links | bodies))


def link_corrections(robot: Robot, solution: Solution) -> dict[str, LinkCorrection]:
    """Mass, centre and inertia of the links that changed, in link axes."""
    links = main_links(robot)
    found = {}
    changes = solution.changes()
    for body, step, change in zip(solution.problem.bodies, solution.steps, changes, strict=True):
        if body.added or np.abs(step).max() < UNCHANGED:
            continue
        name = links[body.node][0]
        T_link_node = invert(robot.places[name].T_node_link)
        own = move_inertia(body_of_vector(body.model + change), T_link_node)
        six = own.inertia[np.triu_indices(3)]
        found[name] = LinkCorrection(_short(own.mass), _all(own.com), _all(six))
    return found


def added_loads(robot: Robot, solution: Solution) -> tuple[Load, ...]:
    """Payloads that were found, in the axes of the links that carry them."""
    loads = []
    for body, change in zip(solution.problem.bodies, solution.changes(), strict=True):
        if body.added:
            name = payload_link(robot, body.node)
            T_link_node = invert(robot.places[name].T_node_link)
            own = move_inertia(body_of_vector(change), T_link_node)
            six = own.inertia[np.triu_indices(3)]
            loads.append(Load(name, _short(own.mass), _all(own.com), _all(six)))
    return tuple(loads)


def description_changes(robot: Robot, new: Robot) -> dict[str, Any]:
    """Top-level keys of `robot.yaml` whose values changed: joints, sensors, links, loads, gravity.

    `joints` and `force_torque_sensors` come as {name: {key: value}} with what is new of each; of
    the joints all are named, because those that a file does not name are not observed.
    """
    changes: dict[str, Any] = {}
    pairs = zip(robot.description.joints, new.description.joints, strict=True)
    joints = {a.name: _joint_changes(a, b) for a, b in pairs}
    if any(joints.values()):
        changes["joints"] = joints
    sensors: dict[str, dict[str, Any]] = {}
    for a, b in zip(robot.description.sensors, new.description.sensors, strict=True):
        changed: dict[str, Any] = (
            {} if a.bias == b.bias else {"bias": [b.bias[i] for i in _axes(b)]}
        )
        if a.delay != b.delay:
            changed["delay"] = b.delay
        if (a.xyz, a.rpy) != (b.xyz, b.rpy):
            changed["pose"] = {"xyz": list(b.xyz), "rpy": list(b.rpy)}
        if changed:
            sensors[b.name] = changed
    if sensors:
        changes["force_torque_sensors"] = sensors
    links = {
        name: {"mass": c.mass, "com": list(c.com or ()), "inertia": list(c.inertia or ())}
        for name, c in new.description.links.items()
        if robot.description.links.get(name) != c
    }
    if links:
        changes["links"] = links
    if new.description.gravity != robot.description.gravity:
        changes["gravity"] = list(new.description.gravity or ())
    if new.description.loads != robot.description.loads:
        changes["loads"] = [
            {
                "link": load.link,
                "mass": load.mass,
                "com": list(load.com),
                "inertia": list(load.inertia),
            }
            for load in new.description.loads
        ]
    return changes


def _axes(sensor: SensorDescription) -> list[int]:
    from touchline.model.description import AXES

    return [AXES.index(axis) for axis in sensor.axes]


def _joint_changes(old: JointDescription, new: JointDescription) -> dict[str, Any]:
    changed: dict[str, Any] = {
        key: getattr(new, key)
        for key in ("gain", "bias", "delay", "rotor_inertia")
        if getattr(new, key) != getattr(old, key)
    }
    if new.friction != old.friction:
        law = new.friction
        changed["friction"] = {"coulomb": law.coulomb, "viscous": law.viscous}
        changed["friction"]["coulomb_width"] = law.coulomb_width
        if law.stribeck:
            changed["friction"]["stribeck"] = law.stribeck
            changed["friction"]["stribeck_speed"] = law.stribeck_speed
    return changed


def _joint(joint: JointDescription, row: int, found: Solution) -> JointDescription:
    return replace(
        joint,
        friction=_friction(joint.friction, row, found),
        bias=_short(joint.bias + found.value("bias", row)),
        rotor_inertia=_short(joint.rotor_inertia + found.value("rotor", row)),
    )


def _friction(law: Friction, row: int, found: Solution) -> Friction:
    width, speed = law.coulomb_width, law.stribeck_speed
    for column in found.problem.columns:
        if column.row == row and column.kind in ("coulomb", "stribeck"):
            width = column.width
            speed = column.speed or speed
    coulomb = max(law.coulomb + found.value("coulomb", row), 0.0)
    stribeck = _short(max(law.stribeck + found.value("stribeck", row), 0.0))
    return Friction(
        coulomb=_short(coulomb),
        viscous=_short(law.viscous + found.value("viscous", row)),
        coulomb_width=width if coulomb > 0.0 or stribeck > 0.0 else law.coulomb_width,
        stribeck=stribeck,
        stribeck_speed=speed if stribeck else law.stribeck_speed,
    )


def _sensor(sensor: SensorDescription, first: int, found: Solution) -> SensorDescription:
    bias = [b + found.value("bias", first + i) for i, b in enumerate(sensor.bias)]
    return replace(sensor, bias=_all(np.array(bias)))


def _changed(robot: Robot, new: RobotDescription, name: str) -> Link:
    """The link as corrected, and its loads."""
    link, place = robot.mechanism.links[name], robot.places[name]
    own = move_inertia(body_of_vector(link_vector(robot, name)), invert(place.T_node_link))
    if name in new.links:
        own = corrected_inertia(own, new.links[name])
    loads = [load_inertia(load) for load in new.loads if load.link == name]
    return replace(link, inertia=combine_inertias([own, *loads]))


def _short(value: float) -> float:
    return float(f"{value:.{DIGITS}g}") if abs(value) > SMALLEST else 0.0


def _all(values: Array) -> tuple[float, ...]:
    return tuple(_short(float(x)) for x in values)
