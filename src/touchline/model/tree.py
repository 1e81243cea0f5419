# SPDX-License-Identifier: Apache-2.0
"""From a mechanism with sensors to the tree of rigid bodies that the native core walks.

A *node* is a rigid body on a moving joint or on a sensor. Its frame is the sensor's, or has its z
axis along the joint. Fixed and locked joints vanish into the nodes that carry them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from touchline.model.description import SensorDescription
from touchline.model.mechanism import Inertia, Joint, Mechanism

Array = NDArray[np.float64]


@dataclass
class Node:
    """One rigid body: where it sits, what it weighs, and what moves it."""

    parent: int
    kind: str
    T_parent_node: Array
    coordinate: int = -1
    multiplier: float = 1.0
    offset: float = 0.0
    sensor: str | None = None
    joint: str | None = None
    links: list[str] = field(default_factory=list)
    inertia: Inertia = field(default_factory=Inertia.zero)


@dataclass(frozen=True)
class Place:
    """Where a link sits: the node that carries it and `T_node_link` (4, 4)."""

    node: int
    T_node_link: Array


def rotation_from_rpy(rpy: tuple[float, ...]) -> Array:
    """Rotation (3, 3) of fixed-axis roll, pitch, yaw [rad], as in URDF."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def transform(rotation: Array, translation: Array | tuple[float, ...]) -> Array:
    """Homogeneous transform (4, 4)."""
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = translation
    return T


def invert(T: Array) -> Array:
    """Inverse of a rigid transform (4, 4)."""
    return transform(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


def rotation_about(axis: Array, angle: float) -> Array:
    """Rotation (3, 3) by `angle` [rad] about the unit vector `axis` (3,) (Rodrigues)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


def rotation_to_axis(axis: Array) -> Array:
    """A rotation (3, 3) whose z column is the unit vector `axis`."""
    helper = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(helper, axis)
    x /= np.linalg.norm(x)
    return np.column_stack([x, np.cross(axis, x), axis])


def shift_inertia(inertia: Inertia, T: Array) -> Inertia:
    """The same body in another frame, of which `T` (4, 4) gives the pose of its own."""
    R = T[:3, :3]
    return Inertia(inertia.mass, R @ inertia.com + T[:3, 3], R @ inertia.inertia @ R.T)


def combine(a: Inertia, b: Inertia) -> Inertia:
    """Two bodies of one frame as one (parallel axes)."""
    mass = a.mass + b.mass
    if mass == 0.0:
        return Inertia(0.0, np.zeros(3), a.inertia + b.inertia)
    com = (a.mass * a.com + b.mass * b.com) / mass
    total = np.zeros((3, 3))
    for part in (a, b):
        d = part.com - com
        total += part.inertia + part.mass * (d @ d * np.eye(3) - np.outer(d, d))
    return Inertia(mass, com, total)


def joint_motion(joint: Joint, position: float) -> Array:
    """Motion (4, 4) of the child's frame by a joint position [rad or m]."""
    if joint.kind == "revolute":
        return transform(rotation_about(joint.axis, position), np.zeros(3))
    return transform(np.eye(3), position * joint.axis)


class TreeBuilder:
    """Walks the links from the root outwards; `nodes` and `places` are the result."""

    def __init__(
        self,
        mechanism: Mechanism,
        coordinates: Mapping[str, int],
        locked: Mapping[str, float],
        sensors: tuple[SensorDescription, ...],
    ) -> None:
        self.nodes: list[Node] = []
        self.places: dict[str, Place] = {}
        self._mechanism = mechanism
        self._coordinates = coordinates
        self._locked = locked
        self._sensors = sensors
        self._children: dict[str, list[Joint]] = {name: [] for name in mechanism.links}
        for joint in mechanism.joints.values():
            self._children[joint.parent].append(joint)
        self._add_root()

    def _add_root(self) -> None:
        root = self._mechanism.root
        if any(sensor.link == root for sensor in self._sensors):
            place = Place(-1, np.eye(4))
        else:
            place = self._new_node(Node(-1, "fixed", np.eye(4)), np.eye(4))
        pending = [(root, place)]
        while pending:
            name, place = pending.pop()
            self._add_link(name, place)
            inner = self.places[name]
            for joint in reversed(self._children[name]):
                pending.append((joint.child, self._across(joint, inner)))

    def _new_node(self, node: Node, T_node_link: Array) -> Place:
        self.nodes.append(node)
        return Place(len(self.nodes) - 1, T_node_link)

    def _add_link(self, name: str, place: Place) -> None:
        for sensor in self._sensors:
            if sensor.link == name:
                T_link_sensor = transform(rotation_from_rpy(sensor.rpy), sensor.xyz)
                node = Node(
                    place.node, "fixed", place.T_node_link @ T_link_sensor, sensor=sensor.name
                )
                place = self._new_node(node, invert(T_link_sensor))
        self.places[name] = place
        node = self.nodes[place.node]
        node.links.append(name)
        inertia = shift_inertia(self._mechanism.links[name].inertia, place.T_node_link)
        node.inertia = combine(node.inertia, inertia)

    def _across(self, joint: Joint, inner: Place) -> Place:
        """The place of the joint's child link, given that of its parent."""
        T_node_child = inner.T_node_link @ joint.T_parent_joint
        if joint.kind == "fixed":
            return Place(inner.node, T_node_child)
        master, multiplier, offset = self._follow(joint)
        if master.name in self._locked:
            position = multiplier * self._locked[master.name] + offset
            return Place(inner.node, T_node_child @ joint_motion(joint, position))
        T_child_axis = transform(rotation_to_axis(joint.axis), np.zeros(3))
        node = Node(
            inner.node,
            joint.kind,
            T_node_child @ T_child_axis,
            self._coordinates[master.name],
            multiplier,
            offset,
            joint=joint.name,
        )
        return self._new_node(node, invert(T_child_axis))

    def _follow(self, joint: Joint) -> tuple[Joint, float, float]:
        """The independent joint that moves this one: its position = multiplier * q + offset."""
        multiplier, offset = 1.0, 0.0
        while joint.mimic is not None:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self._mechanism.joints[joint.mimic.joint]
        return joint, multiplier, offset
