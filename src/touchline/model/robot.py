# SPDX-License-Identifier: Apache-2.0
"""A robot ready to be observed: its description, its mechanism, and what follows from both."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.description import RobotDescription
from touchline.model.kernel import native_observer
from touchline.model.mechanism import Mechanism
from touchline.model.tree import Node, Place, TreeBuilder
from touchline.native import core


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

    Attributes:
        assumed: a sentence for each guess, where the robot was read from a model alone.
    """

    def __init__(
        self,
        description: RobotDescription,
        mechanism: Mechanism,
        assumed: Sequence[str] = (),
    ) -> None:
        self.description = description
        self.assumed = tuple(assumed)
        self.mechanism = mechanism
        self.name = description.name
        self.gravity = np.asarray(mechanism.gravity, dtype=float)
        coordinates = {joint.name: i for i, joint in enumerate(description.joints)}
        builder = TreeBuilder(mechanism, coordinates, description.locked, description.sensors)
        self.nodes: tuple[Node, ...] = tuple(builder.nodes)
        self.places: dict[str, Place] = builder.places

    def __repr__(self) -> str:
        sensors = ", ".join(self.sensor_names) or "none"
        measured = sum(joint.measured for joint in self.description.joints)
        return (
            f"<Robot {self.name}: {len(self.joint_names)} joints, {measured} with torques; "
            f"force-torque sensors: {sensors}; segments: {', '.join(self.segment_names)}>"
        )

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickled without what has been worked out, part of which is native."""
        return type(self), (self.description, self.mechanism, self.assumed)

    def _repr_html_(self) -> str:
        """The robot as a notebook shows it: its skeleton, and bodies with masses and segments."""
        rows = "".join(
            f"<tr><td>{escape(', '.join(body.links))}</td><td>{escape(body.segment)}</td>"
            f"<td>{self.nodes[body.node].inertia.mass:.3g}</td></tr>"
            for body in self.bodies
        )
        head = "<tr><th>links of a body</th><th>segment</th><th>mass [kg]</th></tr>"
        return f"<p>{escape(repr(self))}</p>{self._skeleton()}<table>{head}{rows}</table>"

    def _skeleton(self) -> str:
        """An SVG of the lines between the nodes, seen along y, in the middle of all ranges."""
        poses = self.poses(np.mean(self.ranges, axis=0))
        parents = [node.parent for node in self.nodes]
        points = poses[:, (0, 2), 3] * (1.0, -1.0)
        low, high = points.min(axis=0), points.max(axis=0)
        room = 0.1 * max(*(high - low), 0.1)
        x, y, width, height = (*(low - room), *(high - low + 2 * room))
        lines = "".join(
            f'<path d="M{points[parent][0]:.3f} {points[parent][1]:.3f}L{p[0]:.3f} {p[1]:.3f}"/>'
            for parent, p in zip(parents, points, strict=True)
            if parent >= 0
        )
        size = room / 8
        dots = "".join(f'<circle cx="{p[0]:.3f}" cy="{p[1]:.3f}" r="{size:.3f}"/>' for p in points)
        return (
            f'<svg role="img" aria-label="skeleton of {escape(self.name)}" height="240" '
            f'viewBox="{x:.3f} {y:.3f} {width:.3f} {height:.3f}" stroke="currentColor" '
            f'stroke-width="{size:.3f}" fill="currentColor">{lines}{dots}</svg>'
        )

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

    @cached_property
    def joint_segments(self) -> tuple[str, ...]:
        """The segment that each joint (n,) moves, inboard end first where it moves several."""
        return tuple(
            self._segment_of(next(i for i, node in enumerate(self.nodes) if node.joint == name))
            for name in self.joint_names
        )

    def successors(self, segment: str) -> tuple[str, ...]:
        """The segments that begin where this one ends."""
        begins = [(i, n.sensor) for i, n in enumerate(self.nodes) if n.sensor in self.segment_names]
        return tuple(
            str(name)
            for i, name in begins
            if name != segment and self._segment_of(self.nodes[i].parent) == segment
        )

    @cached_property
    def ranges(self) -> tuple[Array, Array]:
        """Least and largest joint positions (n,) within the limits and half a turn [rad or m]."""
        joints = [self.mechanism.joints[name] for name in self.joint_names]
        limits = np.array([(max(j.lower, -np.pi), min(j.upper, np.pi)) for j in joints])
        low, high = np.sort(limits.reshape(-1, 2), axis=1).T
        return low, high

    def sensor_poses(self, q: Sequence[float] | Array) -> Array:
        """Poses (k, 4, 4) of the sensor frames in world, for joint positions `q` (n,) [rad]."""
        index = {node.sensor: i for i, node in enumerate(self.nodes)}
        return self.poses(q)[[index[name] for name in self.sensor_names]]

    def _path(self, node: int) -> list[int]:
        """The nodes from the world out to `node`, itself included."""
        path = []
        while node >= 0:
            path.append(node)
            node = self.nodes[node].parent
        return path[::-1]

    def joints_inboard_of(self, body: Body) -> tuple[str, ...]:
        """The moving joints between the world and a body, mimicking ones included."""
        joints = (self.nodes[i].joint for i in self._path(body.node))
        return tuple(joint for joint in joints if joint is not None)

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
        return native_observer(self, method, discretization, bandwidth)

    @cached_property
    def _kernel(self) -> core.Observer:
        return self.kernel()

    def _segment_of(self, node: int) -> str:
        six_axis = {s.name for s in self.description.sensors if len(s.axes) == 6}
        names = [self.nodes[i].sensor for i in self._path(node)]
        return next((str(name) for name in reversed(names) if name in six_axis), "root")


def load_robot(robot: str | Path) -> Robot:
    """Reads a robot.

    Args:
        robot: path of a `robot.yaml`, a URDF, an MJCF or a xacro; or the name of a robot that ships
            with Touchline ("sara"), of a model of the installed package example-robot-data
            ("panda"), or of one in the cache of robot_descriptions ("ur5e_mj").

    Without a `robot.yaml` the rest is guessed; `Robot.assumed` says what.

    Raises:
        InputError: with every problem of the file at once.
    """
    from touchline.model.loading import read_model, read_robot_file
    from touchline.model.sources import find_robot

    source = find_robot(robot)
    if source.kind == "description":
        return Robot(*read_robot_file(source.path))
    description, mechanism, guess = read_model(source.path)
    return Robot(description, mechanism, guess.statements())
