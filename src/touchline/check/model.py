# SPDX-License-Identifier: Apache-2.0
"""What the description and its model say by themselves."""

import numpy as np

from touchline.check.findings import Findings
from touchline.check.parity import parity_of
from touchline.identify.regressor import outboard_nodes
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.model.surface import mechanism_surfaces
from touchline.model.transforms import combine_inertias, move_inertia

LIGHTEST, HEAVIEST = 0.01, 500.0  # kg; an arm outside has its masses in other units


def check_model(robot: Robot, findings: Findings) -> None:
    """Masses, segments, bodies, and what the sensors can tell of each other."""
    total = sum(node.inertia.mass for node in robot.nodes)
    rows = [f"  {robot.name}: {len(robot.joint_names)} joints, {total:.4g} kg in all"]
    for body in robot.bodies:
        mass = robot.nodes[body.node].inertia.mass
        others = f" with {', '.join(body.links[1:])}" if len(body.links) > 1 else ""
        rows.append(f"  body {body.name}{others}: {mass:.4g} kg, segment {body.segment}")
    findings.note("model", *rows)
    if not LIGHTEST < total < HEAVIEST:
        findings.find(f"{robot.description.model}: all links together weigh {total:.4g} kg")
    _sensors(robot, findings)
    _parity(robot, findings)
    for warning in robot.warnings:
        findings.find(warning)
    for line in mechanism_surfaces(robot.mechanism).lost:
        findings.find(line)
    _surfaces(robot, findings)


def _surfaces(robot: Robot, findings: Findings) -> None:
    """Links on which no contact can be located, and surfaces that are odd."""
    skin = Skin(robot)
    for line in skin.lost:
        findings.find(line)
    findings.note("surfaces", *(f"  {line}" for line in skin.doubts))


def sensor_node(robot: Robot, sensor: str) -> int:
    """The node that begins at a sensor."""
    return next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor)


def outboard_mass(robot: Robot, sensor: str) -> float:
    """Mass [kg] of all that a sensor carries."""
    nodes = outboard_nodes(robot, sensor_node(robot, sensor))
    return sum(robot.nodes[i].inertia.mass for i in nodes)


def _sensors(robot: Robot, findings: Findings) -> None:
    poses = robot.poses(np.zeros(len(robot.joint_names)))
    for sensor in robot.description.sensors:
        own = sensor_node(robot, sensor.name)
        T_sensor = np.linalg.inv(poses[own])
        nodes = outboard_nodes(robot, own)
        moved = [move_inertia(robot.nodes[i].inertia, T_sensor @ poses[i]) for i in nodes]
        carried = combine_inertias(moved)
        weight = carried.mass * float(np.linalg.norm(robot.gravity))
        com = ", ".join(f"{x:.3f}" for x in carried.com)
        findings.note(
            "sensors",
            f"  {sensor.name} carries {carried.mass:.4g} kg ({weight:.4g} N), centre of mass at "
            f"[{com}] m in its frame with all joints at 0; polarity {sensor.polarity}",
        )
        if carried.mass == 0.0:
            findings.find(f"sensor {sensor.name}: nothing with mass is outboard of it")


def _parity(robot: Robot, findings: Findings) -> None:
    parity = parity_of(robot)
    lines = [
        f"  {parity.signals} measured signals, segments {', '.join(robot.segment_names)}: "
        f"rank {parity.rank} of the parity space while every contact is at the outboard end of "
        "its segment"
    ]
    if parity.rank == 0:
        lines.append("  the sensors cannot check each other: any fault looks like a contact")
    else:
        once = tuple(name for name in parity.blind_once if name not in parity.blind)
        never = _shortened(robot, parity.blind) or "none"
        lines.append(f"  a constant error is never seen of: {never}")
        if once:
            lines.append(f"  only some poses show an error of: {_shortened(robot, once)}")
    pushed = tuple(name for name in parity.pushed if name not in parity.blind)
    if parity.rank > 0 and pushed:
        lines.append(
            f"  many pushes on one body look like an error of: {_shortened(robot, pushed)}"
        )
    if parity.rank > 0 and parity.rubbed:
        lines.append(
            "  no six-axis sensor checks the joint torques: friction of a joint looks like an "
            "error of its torque, so none is told"
        )
    for body in _first_bodies(robot):
        lines.append(
            f"  an error of sensor {body[0]} alone can always be a push on {body[1]}; only joints "
            "that feel more than that contradict it"
        )
    findings.note("redundancy", *lines)


def _shortened(robot: Robot, signals: tuple[str, ...]) -> str:
    """The signals' names; a sensor all of whose axes are there by its own name."""
    left = list(signals)
    for sensor in robot.description.sensors:
        own = [f"{sensor.name}.{axis}" for axis in sensor.axes]
        if set(own) <= set(left):
            left[left.index(own[0])] = f"{sensor.name} (all axes)"
            left = [name for name in left if name not in own]
    return ", ".join(left)


def _first_bodies(robot: Robot) -> list[tuple[str, str]]:
    first: dict[str, str] = {}
    for body in robot.bodies:
        first.setdefault(body.segment, body.name)
    return [(segment, name) for segment, name in first.items() if segment != "root"]
