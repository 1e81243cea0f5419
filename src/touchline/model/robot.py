# SPDX-License-Identifier: Apache-2.0
"""A robot ready to be observed: its description, its mechanism, and what follows from both."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from touchline.model.description import JointDescription, RobotDescription, SensorDescription
from touchline.model.mechanism import Mechanism
from touchline.model.tree import Node, Place, TreeBuilder
from touchline.native import core

Array = NDArray[np.float64]
AXES = ("fx", "fy", "fz", "mx", "my", "mz")


@dataclass(frozen=True)
class Body:
    """Links without joint or sensor between them, named after the most inboard one.

    Measurements separate bodies, not the links of one body.
    """

    name: str
    links: tuple[str, ...]
    node: int
    segment: str


class Robot:
    """A robot description joined with its model.

    Arrays follow `joint_names` (n), `sensor_names` (k) and `segment_names` (m): one segment per
    six-axis sensor in their order, then `root` if the robot's root is not on such a sensor.
    """

    def __init__(self, description: RobotDescription, mechanism: Mechanism) -> None:
        self.description = description
        self.mechanism = mechanism
        self.name = description.name
        self.gravity = np.asarray(mechanism.gravity, dtype=float)
        coordinates = {joint.name: i for i, joint in enumerate(description.joints)}
        builder = TreeBuilder(mechanism, coordinates, description.locked, description.sensors)
        self.nodes: tuple[Node, ...] = tuple(builder.nodes)
        self.places: dict[str, Place] = builder.places

    @property
    def warnings(self) -> tuple[str, ...]:
        """What the model's readers found odd but usable."""
        return self.mechanism.warnings

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the observed joints, in the order of all arrays."""
        return tuple(joint.name for joint in self.description.joints)

    @cached_property
    def sensor_names(self) -> tuple[str, ...]:
        """Names of the force-torque sensors, in the order of all arrays."""
        return tuple(sensor.name for sensor in self.description.sensors)

    @cached_property
    def segment_names(self) -> tuple[str, ...]:
        """Names of the segments: that of the six-axis sensor at the inboard end, or `root`."""
        names = self.sensor_names
        return tuple(names[s] if s >= 0 else "root" for s in self._kernel.segment_sensors)

    @cached_property
    def bodies(self) -> tuple[Body, ...]:
        """The rigid bodies that carry links, from the root outwards."""
        return tuple(
            Body(node.links[0], tuple(node.links), i, self._segment_of(i))
            for i, node in enumerate(self.nodes)
            if node.links
        )

    def body_of(self, link: str) -> Body:
        """The body that a link belongs to."""
        return next(body for body in self.bodies if link in body.links)

    def joints_inboard_of(self, body: Body) -> tuple[str, ...]:
        """The moving joints between the world and a body, mimicking ones included."""
        names = []
        node = body.node
        while node >= 0:
            if (joint := self.nodes[node].joint) is not None:
                names.append(joint)
            node = self.nodes[node].parent
        return tuple(reversed(names))

    def poses(self, q: Sequence[float] | Array) -> Array:
        """Poses (n_nodes, 4, 4) of the nodes in world, for joint positions `q` (n,) [rad]."""
        return self._kernel.poses(np.ascontiguousarray(q, dtype=float))

    def T_world_links(self, q: Sequence[float] | Array) -> dict[str, Array]:
        """Pose (4, 4) of every link in world, for joint positions `q` (n,) [rad or m]."""
        poses = self.poses(q)
        return {name: poses[p.node] @ p.T_node_link for name, p in self.places.items()}

    def terms(self, q: Array, qd: Array) -> tuple[Array, Array]:
        """Generalized momentum and n-bar of all rows (eqs. 11, 12).

        Args:
            q: joint positions (n,) [rad].
            qd: joint velocities (n,) [rad/s].

        Returns:
            Two arrays (n + 6 k,): the joint rows, then six rows per sensor in the sensor frame.
        """
        return self._kernel.terms(np.ascontiguousarray(q), np.ascontiguousarray(qd))

    def kernel(
        self,
        method: str = "segment",
        discretization: str = "automatic",
        bandwidth: float | None = None,
    ) -> core.Observer:
        """A new native observer for this robot; `bandwidth` [rad/s] overrides the description's."""
        joints = [self._joint_row(i, bandwidth) for i in range(len(self.description.joints))]
        sensors = [self._sensor_row(i, bandwidth) for i in range(len(self.description.sensors))]
        return core.Observer(
            [_native_node(node) for node in self.nodes],
            self.gravity.tolist(),
            joints,
            sensors,
            getattr(core.Method, method),
            getattr(core.Discretization, discretization),
        )

    @cached_property
    def _kernel(self) -> core.Observer:
        return self.kernel()

    def _segment_of(self, node: int) -> str:
        six_axis = {s.name for s in self.description.sensors if len(s.axes) == 6}
        while node >= 0:
            name = self.nodes[node].sensor
            if name in six_axis:
                return str(name)
            node = self.nodes[node].parent
        return "root"

    def _joint_row(self, index: int, bandwidth: float | None) -> core.JointRow:
        joint: JointDescription = self.description.joints[index]
        row = core.JointRow()
        kind = "from_sensors" if joint.torque == "from" else joint.torque
        row.torque = getattr(core.Torque, kind)
        row.compensated = getattr(core.Compensated, joint.compensated)
        row.sign, row.gain, row.bias, row.range = joint.sign, joint.gain, joint.bias, joint.range
        row.rotor_inertia = joint.rotor_inertia
        row.coulomb = joint.friction.coulomb
        row.viscous = joint.friction.viscous
        row.coulomb_width = joint.friction.coulomb_width
        model = self.mechanism.joints[joint.name]
        row.lower, row.upper = model.lower, model.upper
        row.bandwidth = bandwidth or self.description.bandwidth_joints[index]
        moved = [i for i, node in enumerate(self.nodes) if node.coordinate == index]
        row.nodes = sorted(moved, key=lambda i: self.nodes[i].joint != joint.name)
        row.sources = [self.sensor_names.index(name) for name in joint.sources]
        return row

    def _sensor_row(self, index: int, bandwidth: float | None) -> core.SensorRow:
        sensor: SensorDescription = self.description.sensors[index]
        row = core.SensorRow()
        row.node = next(i for i, node in enumerate(self.nodes) if node.sensor == sensor.name)
        row.set_axes([axis in sensor.axes for axis in AXES])
        row.sign = 1.0 if sensor.polarity == "outboard" else -1.0
        row.gravity_compensated = sensor.compensated == "gravity"
        row.set_bias(list(sensor.bias))
        row.set_range(list(sensor.range))
        row.bandwidth = bandwidth or self.description.bandwidth_sensors[sensor.name]
        if sensor.frame != "sensor":
            row.turned = True
            if sensor.frame == "world":
                row.log_node = -1
                row.set_log_rotation(np.eye(3).ravel().tolist())
            else:
                place = self.places[sensor.frame]
                row.log_node = place.node
                row.set_log_rotation(place.T_node_link[:3, :3].ravel().tolist())
        return row


def _native_node(node: Node) -> core.Node:
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


def load_robot(path: str | Path) -> Robot:
    """Reads a `robot.yaml`, or a robot that ships with Touchline by its name.

    Raises:
        InputError: with every problem of the file at once.
    """
    from touchline.model.description_file import read_robot_file

    return Robot(*read_robot_file(path))
