# SPDX-License-Identifier: Apache-2.0
"""Where a robot can be touched: points of its surface that a finger could reach."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.model.surface import link_surface
from touchline.model.transforms import rotation_to_axis
from touchline.simulation.mujoco_model import build_model
from touchline.simulation.shapes import surfaces_for_rays

CLEARANCE = 0.03  # m free along the outward normal
STEP_OFF = 1e-5  # m from a surface before a ray looks for the next


@dataclass(frozen=True)
class SurfacePoint:
    """A point of a link's surface.

    Attributes:
        link: that carries it.
        point: (3,) in the link's frame [m].
        normal: (3,) outward, in the link's frame.
    """

    link: str
    point: Array
    normal: Array


class TouchableSurface:
    """Draws points of links' surfaces and tells whether they can be reached.

    Args:
        robot: all its links can be in the way.
        floor: height in world below which nothing is touched [m].
    """

    def __init__(self, robot: Robot, floor: float = 0.0) -> None:
        self._mj: Any = import_module("mujoco")
        self.robot, self.floor = robot, floor
        surfaces = {name: link_surface(link) for name, link in robot.mechanism.links.items()}
        self.surfaces = {name: s for name, s in surfaces.items() if s is not None}
        built = build_model(robot, 1e-3, addition=surfaces_for_rays(self.surfaces))
        self._model, self._data = built.model, self._mj.MjData(built.model)
        self._bodies = built.bodies
        names = {body: link for link, body in built.bodies.items()}
        self._owner = [names[body] for body in built.model.geom_bodyid]

    def draw(self, rng: np.random.Generator, links: Sequence[str]) -> SurfacePoint:
        """A point, uniform over the area of the links together.

        Raises:
            InputError: none of the links has a surface.
        """
        chosen = [link for link in links if link in self.surfaces]
        if not chosen:
            raise InputError(f"robot {self.robot.name}: no surface on any of {', '.join(links)}")
        areas = np.array([self.surfaces[link].areas.sum() for link in chosen])
        link = chosen[rng.choice(len(chosen), p=_shares(areas))]
        surface = self.surfaces[link]
        face = rng.choice(len(surface.areas), p=_shares(surface.areas))
        u, v = rng.random(2)
        if u + v > 1:
            u, v = 1 - u, 1 - v
        a, b, c = surface.vertices[surface.faces[face]]
        return SurfacePoint(link, a + u * (b - a) + v * (c - a), surface.normals[face])

    def place(self, T_world_links: dict[str, Array]) -> None:
        """Moves the links to the poses (4, 4) of `Robot.T_world_links`."""
        for link, body in self._bodies.items():
            T = T_world_links[link]
            geoms = np.flatnonzero(self._model.geom_bodyid == body).tolist()
            self._data.xmat[body], self._data.xpos[body] = T[:3, :3].ravel(), T[:3, 3]
            for g in geoms:
                self._place_geom(g, T)

    def _place_geom(self, geom: int, T: Array) -> None:
        R = np.empty(9)
        self._mj.mju_quat2Mat(R, self._model.geom_quat[geom])
        self._data.geom_xmat[geom] = (T[:3, :3] @ R.reshape(3, 3)).ravel()
        self._data.geom_xpos[geom] = T[:3, :3] @ self._model.geom_pos[geom] + T[:3, 3]

    def reachable(self, point: Array, normal: Array, clearance: float = CLEARANCE) -> bool:
        """Whether a point (3,) of the surface in world can be touched from outside.

        It must lie above the floor and outside all other links, with nothing within `clearance`
        [m] along its outward normal.
        """
        end = point + clearance * normal
        if min(point[2], end[2]) < self.floor:
            return False
        hits = self.hits(point + STEP_OFF * normal, normal)
        if hits and hits[0][0] < clearance:
            return False
        inside: dict[str, int] = {}
        for _, link, leaving in hits:
            inside[link] = inside.get(link, 0) + (1 if leaving else -1)
        return all(count <= 0 for count in inside.values())

    def hits(self, origin: Array, direction: Array) -> list[tuple[float, str, bool]]:
        """All surfaces that a ray meets: distance [m], link, and whether it leaves there.

        Args:
            origin: (3,) in world [m].
            direction: (3,) unit vector.
        """
        found: list[tuple[float, str, bool]] = []
        geom, normal = np.array([-1], dtype=np.int32), np.zeros(3)
        travelled = 0.0
        while len(found) < 200:
            start = origin + travelled * direction
            distance = self._mj.mj_ray(
                self._model, self._data, start, direction, None, 1, -1, geom, normal
            )
            if distance < 0:
                break
            travelled += distance
            found.append((travelled, self._owner[geom[0]], bool(normal @ direction > 0)))
            travelled += STEP_OFF
        return found


def _shares(weights: Array) -> Array:
    return weights / weights.sum()


def touchable_links(robot: Robot) -> dict[str, tuple[str, ...]]:
    """The links with a shape by segment, without those that no joint moves and no sensor carries.

    Raises:
        InputError: there are none.
    """
    segments: dict[str, tuple[str, ...]] = {}
    for body in robot.bodies:
        if body.segment == "root" and not robot.joints_inboard_of(body):
            continue
        links = (robot.mechanism.links[name] for name in body.links)
        shaped = tuple(link.name for link in links if link.collision or link.visual)
        segments[body.segment] = segments.get(body.segment, ()) + shaped
    segments = {name: links for name, links in segments.items() if links}
    if not segments:
        raise InputError(f"robot {robot.name}: no link has a shape that could be touched")
    return segments


def structure(robot: Robot) -> str:
    """The segment that has most links: the arm itself, without hand or handle."""
    segments = touchable_links(robot)
    return max(segments, key=lambda name: len(segments[name]))


def structure_links(robot: Robot) -> tuple[str, ...]:
    """The touchable links of the structure, from the base outwards."""
    return touchable_links(robot)[structure(robot)]


def push_direction(normal: Array, friction: float, rng: np.random.Generator) -> Array:
    """A unit vector (3,) into the surface, uniform over the solid angle of the friction cone.

    Args:
        normal: (3,) outward.
        friction: coefficient; 0 pushes straight in.
        rng: draws it.
    """
    cosine = rng.uniform(1.0 / np.sqrt(1.0 + friction**2), 1.0)
    angle = rng.uniform(0, 2 * np.pi)
    side = rotation_to_axis(normal)[:, :2] @ np.array([np.cos(angle), np.sin(angle)])
    return -cosine * normal - np.sqrt(1.0 - cosine**2) * side
