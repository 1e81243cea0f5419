# SPDX-License-Identifier: Apache-2.0
"""A robot's nodes written as a URDF with its sensors, for peers that read nothing else."""

from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.model.tree import Node

Array = NDArray[np.float64]


def robot_urdf(robot: Robot) -> str:
    """The robot's nodes as a URDF with its sensors as fixed joints, in iDynTree's dialect."""
    root = ElementTree.Element("robot", name=robot.name)
    # A root without mass would be removed with the sensor on it; this one loads nothing.
    _add_link(root, "world", Inertia(1.0, np.zeros(3), np.eye(3)))
    names = [_node_name(node, i) for i, node in enumerate(robot.nodes)]
    for i, node in enumerate(robot.nodes):
        _add_link(root, names[i], node.inertia)
        parent = names[node.parent] if node.parent >= 0 else "world"
        _add_joint(root, node, parent, names[i])
        if node.sensor is not None:
            sensor = ElementTree.SubElement(root, "sensor", name=node.sensor, type="force_torque")
            ElementTree.SubElement(sensor, "parent", joint=f"{names[i]}_joint")
            settings = ElementTree.SubElement(sensor, "force_torque")
            ElementTree.SubElement(settings, "frame").text = "child"
            ElementTree.SubElement(settings, "measure_direction").text = "parent_to_child"
    return ElementTree.tostring(root, encoding="unicode")


def sensor_link(sensor: str) -> str:
    """Name of the link on which a sensor's wrench acts; its frame is the sensor's."""
    return f"{sensor}_body"


def _node_name(node: Node, index: int) -> str:
    return sensor_link(node.sensor) if node.sensor else f"{node.joint or index}_body"


def _add_link(root: ElementTree.Element, name: str, body: Inertia) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(body.com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(body.mass)))
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    places["izz"] = (2, 2)
    values = {key: repr(float(body.inertia[at])) for key, at in places.items()}
    ElementTree.SubElement(inertial, "inertia", values)


def _add_joint(root: ElementTree.Element, node: Node, parent: str, child: str) -> None:
    moving = {"revolute": "continuous", "prismatic": "prismatic"}
    joint = ElementTree.SubElement(
        root, "joint", name=node.joint or f"{child}_joint", type=moving.get(node.kind, "fixed")
    )
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    T = node.T_parent_node
    origin = {"xyz": _numbers(T[:3, 3]), "rpy": _numbers(_rpy(T[:3, :3]))}
    ElementTree.SubElement(joint, "origin", origin)
    if node.coordinate >= 0:
        ElementTree.SubElement(joint, "axis", xyz="0 0 1")
    if node.kind == "prismatic":
        ElementTree.SubElement(joint, "limit", lower="-9", upper="9", effort="0", velocity="0")


def _rpy(R: Array) -> Array:
    """Fixed-axis roll, pitch, yaw [rad] of a rotation."""
    flat = np.hypot(R[0, 0], R[1, 0])
    if flat < 1e-12:  # roll and yaw turn about the same axis
        return np.array([np.arctan2(-R[1, 2], R[1, 1]), np.arctan2(-R[2, 0], flat), 0.0])
    roll, yaw = np.arctan2(R[2, 1], R[2, 2]), np.arctan2(R[1, 0], R[0, 0])
    return np.array([roll, np.arctan2(-R[2, 0], flat), yaw])


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
