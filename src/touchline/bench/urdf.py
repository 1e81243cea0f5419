# SPDX-License-Identifier: Apache-2.0
"""A robot's nodes written as a URDF with its sensors, for peers that read nothing else."""

from xml.etree import ElementTree

import numpy as np

from touchline.arrays import Array
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.model.tree import Node


def robot_urdf(robot: Robot, free_sensors: bool = False) -> str:
    """The robot's nodes as a URDF with its sensors as joints, in iDynTree's dialect.

    Args:
        robot: the robot; without joints that mimic others.
        free_sensors: sensors are joints of type `floating` instead of `fixed`.
    """
    root = ElementTree.Element("robot", name=robot.name)
    # A root without mass would be removed with the sensor on it; this one loads nothing.
    _add_link(root, "world", Inertia(1.0, np.zeros(3), np.eye(3)))
    carriers = {-1: ("world", np.eye(4))}
    for i, node in enumerate(robot.nodes):
        parent, T = carriers[node.parent]
        T = T @ node.T_parent_node
        if node.parent < 0 and node.joint is None and node.sensor is None:
            carriers[i] = parent, T  # stands still, and nothing feels its weight
            continue
        carriers[i] = node_link(robot, i), np.eye(4)
        _add_link(root, node_link(robot, i), node.inertia)
        _add_joint(root, node, T, parent, node_link(robot, i), free_sensors)
        if node.sensor is not None:
            sensor = ElementTree.SubElement(root, "sensor", name=node.sensor, type="force_torque")
            ElementTree.SubElement(sensor, "parent", joint=sensor_joint(node.sensor))
            settings = ElementTree.SubElement(sensor, "force_torque")
            ElementTree.SubElement(settings, "frame").text = "child"
            ElementTree.SubElement(settings, "measure_direction").text = "parent_to_child"
    return ElementTree.tostring(root, encoding="unicode")


def node_link(robot: Robot, index: int) -> str:
    """Name of the link that a node has become; its frame is the node's."""
    node = robot.nodes[index]
    return sensor_link(node.sensor) if node.sensor else f"{node.joint}_body"


def sensor_link(sensor: str) -> str:
    """Name of the link on which a sensor's wrench acts; its frame is the sensor's."""
    return f"{sensor}_body"


def sensor_joint(sensor: str) -> str:
    """Name of the joint that a sensor has become."""
    return f"{sensor_link(sensor)}_joint"


def _add_link(root: ElementTree.Element, name: str, body: Inertia) -> None:
    inertial = ElementTree.SubElement(ElementTree.SubElement(root, "link", name=name), "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(body.com), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(body.mass)))
    places = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2)}
    places["izz"] = (2, 2)
    values = {key: repr(float(body.inertia[at])) for key, at in places.items()}
    ElementTree.SubElement(inertial, "inertia", values)


def _add_joint(
    root: ElementTree.Element, node: Node, T: Array, parent: str, child: str, free: bool
) -> None:
    moving = {"revolute": "revolute", "prismatic": "prismatic"}
    kind = moving.get(node.kind, "floating" if free else "fixed")
    joint = ElementTree.SubElement(root, "joint", name=node.joint or f"{child}_joint", type=kind)
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=child)
    origin = {"xyz": _numbers(T[:3, 3]), "rpy": _numbers(_rpy(T[:3, :3]))}
    ElementTree.SubElement(joint, "origin", origin)
    if node.coordinate >= 0:
        ElementTree.SubElement(joint, "axis", xyz="0 0 1")
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
