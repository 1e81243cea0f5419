# SPDX-License-Identifier: Apache-2.0
"""The surfaces of all links of a robot, ready for lines and points."""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.model.robot import Body, Robot
from touchline.model.surface import Surface, mechanism_surfaces
from touchline.model.transforms import move_points
from touchline.model.tree import invert
from touchline.native import core


@dataclass(frozen=True)
class Patch:
    """The surface of one link, in the frame of the node that carries it.

    Attributes:
        link: name of the link, and `body` of the rigid body it belongs to.
        node: index of the node in `robot.nodes`.
        segment: name of the segment that feels it; None if no sensor can.
        T_node_link: (4, 4).
        surface: in the link's frame.
        mesh: native, in the node's frame.
    """

    link: str
    body: str
    node: int
    segment: str | None
    T_node_link: Array
    surface: Surface
    mesh: core.Mesh


@dataclass(frozen=True)
class Crossing:
    """Where a line goes through a link's surface.

    Attributes:
        link: name of the link.
        distance: along the line from its origin [m]; negative behind it.
        position: (3,) [m] and `normal` (3,), outward, in world.
        entry: does the line go in here?
    """

    link: str
    distance: float
    position: Array
    normal: Array
    entry: bool


# By link and bytes of `T_node_link`: a link's node differs only with the sensors on it, so robots
# of the same links share them.
Meshes = dict[tuple[str, bytes], core.Mesh]


class Skin:
    """All link surfaces of a robot.

    Args:
        robot: the robot.
        kind: "collision" or "visual" shapes.

    Attributes:
        patches: one per link with a surface.
        lost: a line for each surface that cannot be used.
        doubts: a line for each that is odd but used.
    """

    def __init__(self, robot: Robot, kind: str = "collision") -> None:
        self.robot = robot
        self.patches, self.lost, self.doubts, self._moved = _worn(robot, kind)

    def on(self, robot: Robot) -> "Skin":
        """The same surfaces on a robot of the same links with other sensors."""
        skin = object.__new__(Skin)
        skin.robot, skin.lost, skin.doubts = robot, self.lost, self.doubts
        skin._moved = self._moved
        names = set(robot.segment_names)
        bodies = {link: body for body in robot.bodies for link in body.links}
        skin.patches = tuple(
            _moved_patch(robot, patch, bodies[patch.link], names, self._moved)
            for patch in self.patches
        )
        return skin

    def check_robot(self, robot: Robot) -> None:
        """Checks that these are the surfaces of a robot, or of one with the same links.

        Raises:
            ValueError: they are another robot's.
        """
        if robot is self.robot:
            return
        for patch in self.patches:
            place = robot.places.get(patch.link)
            if place is None:
                what = f"'{patch.link}', which {robot.name} lacks"
            elif place.node != patch.node or not np.allclose(place.T_node_link, patch.T_node_link):
                what = f"'{patch.link}', which stands elsewhere on {robot.name}"
            else:
                continue
            raise ValueError(f"skin is that of another robot ({self.robot.name}): it has {what}")

    def crossings(
        self, q: ArrayLike, origin: ArrayLike, direction: ArrayLike, segment: str | None = None
    ) -> list[Crossing]:
        """Every place where a line goes into or out of a link, along the line.

        Args:
            q: joint positions (n,) [rad or m].
            origin: a point (3,) [m] of the line, in world.
            direction: of the line (3,), in world, of any length.
            segment: only the links of this segment.
        """
        poses = self.robot.poses(np.asarray(q, float))
        origin = np.asarray(origin, float)
        unit = np.asarray(direction, float) / np.linalg.norm(direction)
        found = []
        for patch in self.patches:
            if segment not in (None, patch.segment):
                continue
            R, p = poses[patch.node][:3, :3], poses[patch.node][:3, 3]
            rows = patch.mesh.crossings(R.T @ (origin - p), R.T @ unit)
            for t, _, *normal in rows:
                outward = R @ np.array(normal)
                entry = bool(outward @ unit < 0)
                found.append(Crossing(patch.link, float(t), origin + t * unit, outward, entry))
        return sorted(found, key=lambda crossing: crossing.distance)

    def links_around(self, q: ArrayLike, point: ArrayLike) -> list[str]:
        """The links whose closed surface holds a point (3,) [m] of the world."""
        # A direction in general position: along no edge of what people build.
        direction = np.array([0.5381, 0.2917, 0.7908])
        count: dict[str, int] = {}
        for crossing in self.crossings(q, point, direction):
            if crossing.distance > 0:
                count[crossing.link] = count.get(crossing.link, 0) + (-1 if crossing.entry else 1)
        return [link for link, depth in count.items() if depth > 0]

    def nearest(self, q: ArrayLike, link: str, point: ArrayLike) -> tuple[float, Array]:
        """Distance [m] and place (3,) [m] of the point of a link's surface nearest to `point`."""
        patch = next(patch for patch in self.patches if patch.link == link)
        T = self.robot.poses(np.asarray(q, float))[patch.node]
        local = T[:3, :3].T @ (np.asarray(point, float) - T[:3, 3])
        row = patch.mesh.nearest_to_point(local)[0]
        return float(row[0]), T[:3, :3] @ row[2:5] + T[:3, 3]


@lru_cache(maxsize=4)  # pipelines on one robot search the same surfaces
def _worn(
    robot: Robot, kind: str
) -> tuple[tuple[Patch, ...], tuple[str, ...], tuple[str, ...], Meshes]:
    """Patches of a robot, what is lost and doubtful of its surfaces, and meshes made so far."""
    surfaces = mechanism_surfaces(robot.mechanism, kind)
    names = set(robot.segment_names)
    bodies = {link: body for body in robot.bodies for link in body.links}
    meshes: Meshes = {}
    patches = tuple(
        _patch(robot, link, surface, bodies[link], names, meshes)
        for link, surface in surfaces.by_link.items()
        if link in bodies
    )
    return patches, surfaces.lost, surfaces.doubts, meshes


def _patch(
    robot: Robot, link: str, surface: Surface, body: Body, segments: set[str], meshes: Meshes
) -> Patch:
    place = robot.places[link]
    T = place.T_node_link
    key = link, T.tobytes()
    if key not in meshes:
        vertices = np.ascontiguousarray(move_points(surface.vertices, T))
        meshes[key] = core.mesh(vertices, np.ascontiguousarray(surface.faces, np.int64))
    mesh = meshes[key]
    felt = _felt(robot, body, place.node, segments)
    return Patch(link, body.name, place.node, felt, T, surface, mesh)


def _moved_patch(
    robot: Robot, patch: Patch, body: Body, segments: set[str], meshes: Meshes
) -> Patch:
    """The same surface where a robot of the same links carries it."""
    place = robot.places[patch.link]
    if not np.array_equal(place.T_node_link, patch.T_node_link):
        return _patch(robot, patch.link, patch.surface, body, segments, meshes)
    felt = _felt(robot, body, place.node, segments)
    return replace(patch, body=body.name, node=place.node, segment=felt)


def _felt(robot: Robot, body: Body, node: int, segments: set[str]) -> str | None:
    """The segment that feels a body. What stands inboard of all joints and sensors none feels."""
    felt = body.segment in segments and (body.segment != "root" or _moves(robot, node))
    return body.segment if felt else None


def _moves(robot: Robot, node: int) -> bool:
    while node >= 0:
        if robot.nodes[node].kind != "fixed":
            return True
        node = robot.nodes[node].parent
    return False


def in_link(patch: Patch, T_world_node: Array, point: Array) -> Array:
    """A point (3,) of the world in the frame of a patch's link."""
    T_link_world = invert(T_world_node @ patch.T_node_link)
    return T_link_world[:3, :3] @ point + T_link_world[:3, 3]
