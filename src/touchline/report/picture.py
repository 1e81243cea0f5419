# SPDX-License-Identifier: Apache-2.0
"""Pictures of a robot being touched: points, forces and uncertainty drawn on its surface."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.model.robot import Robot
from touchline.report.render import solids
from touchline.report.render.camera import Camera, Size
from touchline.report.render.canvas import Canvas
from touchline.report.render.light import (
    MAP,
    SMALL_MAP,
    FloorContact,
    Lights,
    ShadowMap,
    doubled,
    shaded,
)
from touchline.report.render.png import png_bytes
from touchline.report.render.raster import box
from touchline.report.render.skin import Piece, Triangles, posed_skin

__all__ = ["Camera", "Mark", "Scene", "png_bytes"]

Array = NDArray[np.floating[Any]]

SIGMAS = 2.0  # of the drawn ellipsoid
FORCE_SCALE, SHORTEST, LONGEST = 0.010, 0.09, 0.42  # m/N, m, m, for an arm of 1.5 m

# Okabe and Ito's vermilion and blue: told apart with any colour vision.
COLOURS = {"truth": "#0072b2", "estimate": "#d55e00", "candidate": "#e69f00"}
SHELL, TRIM, TINT = "#f1f2f4", "#5d646d", "#ffd39e"
SMALL = 420  # pixels; a picture up to this wide is small
SKY, FLOOR = "#f8f9fb", "#e4e8ed"


def linear(colour: str) -> Array:
    """A colour (3,) as light, from its name `#rrggbb` in sRGB."""
    value = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    return value**2.2


@dataclass(frozen=True)
class Mark:
    """A contact to draw.

    Attributes:
        position: (3,) [m] in world.
        force: (3,) [N] on the robot, in world; None where it is not known.
        kind: one of `COLOURS`.
        covariance: (3, 3) [m2] of the position.
        label: what stands beside the arrow's tail.
        is_point: whether the point is known; without, the arrow only stands for the force.
    """

    position: Array
    force: Array | None
    kind: str
    covariance: Array | None
    label: str
    is_point: bool = True


class Scene:
    """A robot at a configuration, and what is to be drawn on it.

    Args:
        robot: the robot.
        q: (n,) joint positions [rad or m].
    """

    def __init__(self, robot: Robot, q: Array) -> None:
        self.robot = robot
        self.q = np.array(q, float)
        self.marks: list[Mark] = []
        self._tints: dict[str, float] = {}
        self._skin = posed_skin(robot, self.q)
        self._surface = Triangles.joined([triangles for _, triangles in self._skin])

    @property
    def pieces(self) -> list[Piece]:
        """The drawn shapes; `part` of `surface` counts them."""
        return [piece for piece, _ in self._skin]

    @property
    def surface(self) -> Triangles:
        """All triangles of the robot in world."""
        return self._surface

    @cached_property
    def extent(self) -> float:
        """Length [m] of the diagonal of the box around the robot."""
        if not len(self._surface.corners):
            return 1.0
        low, high = self._box
        return float(np.linalg.norm(high - low))

    @cached_property
    def _box(self) -> tuple[Array, Array]:
        return box(self._surface.corners)

    @cached_property
    def balls(self) -> tuple[Array, Array]:
        """Middles (T, 3) and radii (T,) [m] of balls around the triangles."""
        corners = self._surface.corners.astype(np.float32)
        middle = corners.mean(axis=1)
        apart = ((corners - middle[:, None]) ** 2).sum(axis=2)
        return middle, np.sqrt(apart.max(axis=1)) * np.float32(1.001)

    @property
    def _unit(self) -> float:
        """Sizes of marks are those for an arm of 1.5 m times this."""
        return self.extent / 1.5

    def add_contact(
        self,
        position: Array,
        force: Array | None,
        kind: str = "estimate",
        covariance: Array | None = None,
        label: str | None = None,
        is_point: bool = True,
    ) -> None:
        """Draw a contact: its point, its force and how uncertain the point is.

        Args:
            position: (3,) [m] in world.
            force: (3,) [N] on the robot, world axes; None draws the point alone.
            kind: "estimate", "truth" or "candidate", which have colours of their own.
            covariance: (3, 3) [m2] of the position, drawn as an ellipsoid of two sigma.
            label: beside the arrow; by default the force's size.
            is_point: False draws the force alone: the arrow does not claim to touch there.

        Raises:
            ValueError: an unknown kind.
        """
        if kind not in COLOURS:
            raise ValueError(f"kind '{kind}'; allowed: {', '.join(COLOURS)}")
        size = None if force is None else float(np.linalg.norm(force))
        if label is None:
            label = "" if size is None else f"{size:.1f} N"
        force = np.asarray(force, float) if size else None
        position = np.asarray(position, float)
        self.marks.append(Mark(position, force, kind, covariance, label, is_point))

    def highlight(self, link: str, strength: float = 1.0) -> None:
        """Tint a link; `strength` from 0 to 1."""
        self._tints[link] = strength

    def arrow(self, mark: Mark) -> tuple[Array, Array]:
        """Tail and tip (3,) [m] of a mark's arrow; the tip is the contact."""
        if mark.force is None:
            return mark.position, mark.position
        size = float(np.linalg.norm(mark.force))
        length = np.clip(FORCE_SCALE * size, SHORTEST, LONGEST) * self._unit
        return mark.position - mark.force / size * length, mark.position

    def points(self) -> Array:
        """Points (N, 3) [m] that a picture should show: the robot and the arrows."""
        ends = [end for mark in self.marks for end in self.arrow(mark)]
        return np.vstack([self._surface.corners.reshape(-1, 3), *ends])

    def render(self, camera: Camera, size: Size = (640, 640)) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) in sRGB, of `size` (width, height) [pixels]."""
        lights = Lights.of(camera)
        floor = float(self._box[0][2])
        canvas = Canvas(camera, size)
        fine = MAP if max(size) > SMALL else SMALL_MAP
        shadow = ShadowMap(self._surface.corners, lights.key, fine)
        ground = self._ground(camera, size, shadow, lights.key, floor)
        body = canvas.see(self._surface, self._closed())
        albedo = self._albedo()[body.part]
        lit = shadow.lit(body.position, body.normal)
        colour = shaded(lights, body.normal, albedo, lit)
        canvas.put(ground, body, colour)
        canvas.hides(body)
        for triangles, tint, opacity in self._overlays():
            seen = canvas.see(triangles)
            colour = 0.5 * shaded(lights, seen.normal, linear(tint)[None], 0.6)
            canvas.put_over(seen, colour + 0.6 * linear(tint).astype(np.float32), opacity)
        return canvas.image

    def _closed(self) -> NDArray[np.bool_]:
        closed = np.array([piece.closed for piece in self.pieces], bool)
        return closed[self._surface.part]

    def _albedo(self) -> Array:
        colours = []
        for piece in self.pieces:
            base = linear(TRIM if piece.trim else SHELL)
            strength = self._tints.get(piece.link, 0.0) * (0.55 if piece.trim else 1.0)
            colours.append(base + strength * (linear(TINT) - base))
        return np.array(colours)

    def _ground(
        self, camera: Camera, size: Size, shadow: ShadowMap, key: Array, floor: float
    ) -> Array:
        """The background (H, W, 3): a calm gradient with the robot's shadow on the floor."""
        width, height = size
        fade = np.linspace(0, 1, height)[:, None] ** 1.2
        ground = linear(SKY) * (1 - fade) + linear(FLOOR) * fade
        coarse = ((width + 1) // 2, (height + 1) // 2)  # shadows are soft
        rays = camera.rays(coarse)
        below = np.flatnonzero(rays[:, 2] < -1e-3)
        points = camera.eye + rays[below] * ((floor - camera.eye[2]) / rays[below, 2])[:, None]
        foot = FloorContact(self._surface.corners, floor)
        dark = np.zeros(len(rays), np.float32)
        dark[below] = 1 - (1 - 0.34 * shadow.shade_on_floor(points)) * (1 - 0.45 * foot.at(points))
        dark = doubled(dark.reshape(coarse[::-1]))[:height, :width, None]
        return ground[:, None].astype(np.float32) * (
            1 - dark * np.array([1.0, 0.97, 0.92], np.float32)
        )

    def _overlays(self) -> list[tuple[Triangles, str, float]]:
        """What is drawn over the robot: (triangles, colour, opacity), in order."""
        layers, unit = [], self._unit
        marks = sorted(self.marks, key=lambda mark: list(COLOURS).index(mark.kind))
        for mark in marks:
            colour = COLOURS[mark.kind]
            if mark.covariance is not None:
                axes = solids.spread(mark.covariance, SIGMAS, 1e-4)
                layers.append((solids.ellipsoid(mark.position, axes), colour, 0.38))
            if mark.force is not None and mark.is_point and mark.kind == "estimate":
                along = mark.force / np.linalg.norm(mark.force) * 0.4 * unit
                line = solids.rod(mark.position, mark.position + along, 0.0016 * unit)
                layers.append((line, colour, 0.8))
        for mark in marks:
            # The truth is wider and clear, so that both are seen where they coincide.
            radius, opacity = (0.0095, 0.9) if mark.kind == "truth" else (0.0065, 1.0)
            if mark.is_point:
                ball = solids.ball(mark.position, 1.75 * radius * unit)
                layers.append((ball, COLOURS[mark.kind], opacity))
            if mark.force is not None:
                arrow = solids.arrow(*self.arrow(mark), radius * unit)
                layers.append((arrow, COLOURS[mark.kind], opacity))
        return layers
