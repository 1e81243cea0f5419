# SPDX-License-Identifier: Apache-2.0
"""From a mechanism with sensors to the tree of rigid bodies that the native core walks.

A *node* is a rigid body on a moving joint or on a sensor. Its frame is the sensor's, or has its z
axis along the joint. Fixed and locked joints vanish into the nodes that carry them.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from touchline.arrays import Array
from touchline.model.description import SensorDescription
from touchline.model.mechanism import Inertia, Joint, Mechanism
from touchline.model.transforms import (
    combine_inertias,
    joint_motion,
    move_inertia,
    pose,
    pose_rpy,
    rotation_to_axis,
)


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


def invert(T: Array) -> Array:
    """Inverse of a rigid transform (4, 4)."""
    return pose(T[:3, :3].T, -T[:3, :3].T @ T[:3, 3])


@lru_cache(maxsize=64)  # joints turn about a few axes, also in arms that errors are drawn of
def _along(axis: tuple[float, float, float]) -> tuple[Array, Array]:
    """The pose (4, 4) in a link of a frame with z along `axis`, and its inverse; read-only."""
    T = pose(rotation_to_axis(np.array(axis)))
    made = T, invert(T)
    for pose_of in made:
        pose_of.setflags(write=False)
    return made


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
                T_link_sensor = pose_rpy(sensor.xyz, sensor.rpy)
                node = Node(
                    place.node, "fixed", place.T_node_link @ T_link_sensor, sensor=sensor.name
                )
                place = self._new_node(node, invert(T_link_sensor))
        self.places[name] = place
        node = self.nodes[place.node]
        node.links.append(name)
        inertia = move_inertia(self._mechanism.links[name].inertia, place.T_node_link)
        node.inertia = combine_inertias([node.inertia, inertia])

    def _across(self, joint: Joint, inner: Place) -> Place:
        """The place of the joint's child link, given that of its parent."""
        T_node_child = inner.T_node_link @ joint.T_parent_joint
        if joint.kind == "fixed":
            return Place(inner.node, T_node_child)
        master, multiplier, offset = self._follow(joint)
        if master.name in self._locked:
            position = multiplier * self._locked[master.name] + offset
            return Place(inner.node, T_node_child @ joint_motion(joint.kind, joint.axis, position))
        T_child_axis, T_axis_child = _along(tuple(joint.axis.tolist()))
        node = Node(
            inner.node,
            joint.kind,
            T_node_child @ T_child_axis,
            self._coordinates[master.name],
            multiplier,
            offset,
            joint=joint.name,
        )
        return self._new_node(node, T_axis_child)

    def _follow(self, joint: Joint) -> tuple[Joint, float, float]:
        """The independent joint that moves this one: its position = multiplier * q + offset."""
        multiplier, offset = 1.0, 0.0
        while joint.mimic is not None:
            offset += multiplier * joint.mimic.offset
            multiplier *= joint.mimic.multiplier
            joint = self._mechanism.joints[joint.mimic.joint]
        return joint, multiplier, offset
