# SPDX-License-Identifier: Apache-2.0
"""A robot in the words of the native core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Protocol

import numpy as np

from touchline.arrays import Array
from touchline.model.description import AXES, RobotDescription
from touchline.model.mechanism import Mechanism
from touchline.model.tree import Node, Place
from touchline.native import core


class Kernelled(Protocol):
    """What a kernel needs to know of a robot: a `Robot` is one."""

    @property
    def description(self) -> RobotDescription:
        """What `robot.yaml` says."""
        ...

    @property
    def mechanism(self) -> Mechanism:
        """The model."""
        ...

    @property
    def nodes(self) -> Sequence[Node]:
        """The tree, a parent before its children."""
        ...

    @property
    def places(self) -> Mapping[str, Place]:
        """Where each link is."""
        ...

    @property
    def gravity(self) -> Array:
        """(3,) in world [m/s2]."""
        ...


def native_observer(
    robot: Kernelled, method: str, discretization: str, bandwidth: float | None
) -> core.Observer:
    """A native observer; `bandwidth` [rad/s] overrides the description's."""
    return core.Observer(
        [native_node(node) for node in robot.nodes],
        robot.gravity.tolist(),
        [joint_row(robot, i, bandwidth) for i in range(len(robot.description.joints))],
        [sensor_row(robot, i, bandwidth) for i in range(len(robot.description.sensors))],
        getattr(core.Method, method),
        getattr(core.Discretization, discretization),
    )


def native_node(node: Node) -> core.Node:
    """A body on its joint or sensor."""
    T, body = node.T_parent_node, node.inertia
    return core.node(
        node.parent,
        getattr(core.NodeKind, node.kind),
        T[:3, :3].ravel().tolist(),
        T[:3, 3].tolist(),
        body.mass,
        body.com.tolist(),
        body.inertia.ravel().tolist(),
        node.coordinate,
        node.multiplier,
        node.offset,
    )


def joint_row(robot: Kernelled, index: int, bandwidth: float | None) -> core.JointRow:
    """A joint with its channel; `bandwidth` [rad/s] overrides the description's."""
    joint = robot.description.joints[index]
    row = core.JointRow()
    row.torque = getattr(core.Torque, {"from": "from_sensors"}.get(joint.torque, joint.torque))
    row.compensated = getattr(core.Compensated, joint.compensated)
    row.sign, row.gain, row.bias, row.range = joint.sign, joint.gain, joint.bias, joint.range
    row.rotor_inertia = joint.rotor_inertia
    row.coulomb = joint.friction.coulomb
    row.viscous = joint.friction.viscous
    row.coulomb_width = joint.friction.coulomb_width
    row.stribeck = joint.friction.stribeck
    row.stribeck_speed = joint.friction.stribeck_speed
    if joint.rest is not None:
        row.set_rest(joint.rest.q, joint.rest.qd, joint.rest.torque)
    model = robot.mechanism.joints[joint.name]
    row.lower, row.upper = model.lower, model.upper
    row.bandwidth = bandwidth or robot.description.bandwidth_joints[index]
    moved = [i for i, node in enumerate(robot.nodes) if node.coordinate == index]
    row.nodes = sorted(moved, key=lambda i: robot.nodes[i].joint != joint.name)
    names = [sensor.name for sensor in robot.description.sensors]
    row.sources = [names.index(name) for name in joint.sources]
    return row


def sensor_row(robot: Kernelled, index: int, bandwidth: float | None) -> core.SensorRow:
    """A sensor with its channels; `bandwidth` [rad/s] overrides the description's."""
    sensor = robot.description.sensors[index]
    row = core.SensorRow()
    row.node = next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor.name)
    row.set_axes([axis in sensor.axes for axis in AXES])
    row.sign = 1.0 if sensor.polarity == "outboard" else -1.0
    row.gravity_compensated = sensor.compensated == "gravity"
    row.set_bias(list(sensor.bias))
    row.set_range(list(sensor.range))
    row.bandwidth = bandwidth or robot.description.bandwidth_sensors[sensor.name]
    if sensor.frame != "sensor":
        row.turned = True
        row.log_node, R_node_log = -1, np.eye(3)
        if sensor.frame != "world":
            place = robot.places[sensor.frame]
            row.log_node, R_node_log = place.node, place.T_node_link[:3, :3]
        row.set_log_rotation(R_node_log.ravel().tolist())
    return row
