# SPDX-License-Identifier: Apache-2.0
"""A robot on the page: its links as meshes that follow the joints."""

from dataclasses import replace

import numpy as np
import trimesh
import viser

from touchline.arrays import Array, Index
from touchline.model.mechanism import Geometry, Link
from touchline.model.robot import Robot
from touchline.model.surface import Surface, link_surface
from touchline.view.pose import quaternions

Colour = tuple[int, int, int]

SHELL, TRIM = (241, 242, 244), (93, 100, 109)
GRID = (176, 180, 185)  # is seen on white and does not glare on black
TINT, ALARM = (255, 190, 110), (235, 90, 80)  # of links that are touched, or hit
CREASE = np.deg2rad(35.0)  # edges sharper than this stay sharp
GROUND = 4.0  # m


class RobotScene:
    """The links of a robot.

    Args:
        scene: of a viser server.
        robot: that is drawn, at first with all joints at 0.

    Attributes:
        meshes: handles of the drawn shapes by link.
    """

    def __init__(self, scene: viser.SceneApi, robot: Robot) -> None:
        self.robot, self._scene = robot, scene
        self.meshes: dict[str, list[viser.MeshHandle]] = {}
        self._frames: dict[str, viser.FrameHandle] = {}
        self._tinted: dict[str, Colour] = {}
        for link in robot.mechanism.links.values():
            self._add(link)
        self.place(np.zeros(len(robot.joint_names)))

    def _add(self, link: Link) -> None:
        name = f"/robot/{link.name}"
        self._frames[link.name] = self._scene.add_frame(name, show_axes=False)
        self.meshes[link.name] = []
        for i, (surface, colour) in enumerate(_drawn(link)):
            vertices, faces = sharp(surface)
            handle = self._scene.add_mesh_simple(f"{name}/{i}", vertices, faces, color=colour)
            self.meshes[link.name].append(handle)

    def place(self, q: Array) -> None:
        """Moves the links to where joint positions `q` (n,) [rad or m] put them."""
        poses = self.robot.T_world_links(q)
        turns = quaternions(np.array([poses[name][:3, :3] for name in self._frames]))
        for (name, frame), wxyz in zip(self._frames.items(), turns, strict=True):
            frame.wxyz, frame.position = wxyz, poses[name][:3, 3]

    def tint(self, links: frozenset[str], alarmed: frozenset[str] = frozenset()) -> None:
        """Colours links, some of them as alarmed; the others get their own colours back."""
        wanted = {link: ALARM if link in alarmed else TINT for link in links | alarmed}
        for link in wanted.keys() | self._tinted.keys():
            if wanted.get(link) != self._tinted.get(link):
                own = _colours(self.robot.mechanism.links[link])
                for mesh, (_, colour) in zip(self.meshes[link], own, strict=True):
                    mesh.color = wanted.get(link, colour)
        self._tinted = wanted


def dress(page: viser.ViserServer) -> None:
    """Light, floor and camera for an arm that stands at the origin and reaches about a metre."""
    scene = page.scene
    scene.configure_environment_map(None)  # the light below is enough, and costs less
    scene.configure_default_lights(True, cast_shadow=False)
    scene.add_light_ambient("/light/ambient", intensity=1.2)
    scene.add_grid("/ground", GROUND, GROUND, cell_color=GRID, section_color=GRID)
    page.initial_camera.position = (1.45, 1.05, 1.05)
    page.initial_camera.look_at = (0.2, 0.05, 0.5)


def _drawn(link: Link) -> list[tuple[Surface, Colour]]:
    """The shapes of a link that can be drawn, with their colours."""
    found = []
    for shape, colour in _colours(link):
        surface = link_surface(replace(link, visual=(shape,), collision=()), "visual")
        if surface is not None:
            found.append((surface, colour))
    return found


def _colours(link: Link) -> list[tuple[Geometry, Colour]]:
    """Shapes that only decorate others are darker."""
    shapes = link.visual or link.collision
    solid = {(shape.kind, shape.path) for shape in link.collision}
    touchable = [(shape.kind, shape.path) in solid for shape in shapes]
    return [
        (shape, SHELL if touched or not any(touchable) else TRIM)
        for shape, touched in zip(shapes, touchable, strict=True)
    ]


def sharp(surface: Surface) -> tuple[Array, Index]:
    """Vertices and faces, the vertices doubled along sharp edges so that these are not rounded."""
    mesh = trimesh.Trimesh(surface.vertices, surface.faces, process=False)
    shaded = trimesh.graph.smooth_shade(mesh, angle=CREASE)
    return np.asarray(shaded.vertices, np.float64), np.asarray(shaded.faces, np.int64)
