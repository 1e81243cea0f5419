# SPDX-License-Identifier: Apache-2.0
"""Pictures of a robot being touched: points, forces and uncertainty drawn on its surface."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from touchline import _render
from touchline.arrays import Floats
from touchline.figure import CANDIDATE, FELT, TRUE
from touchline.model.robot import Robot
from touchline.report.render import solids
from touchline.report.render.camera import Camera, Size
from touchline.report.render.png import png_bytes
from touchline.report.render.skin import Piece, Triangles, native_skin, robot_skin

__all__ = ["Camera", "Mark", "Scene", "png_bytes"]

SIGMAS = 2.0  # of the drawn ellipsoid
FORCE_SCALE, SHORTEST, LONGEST = 0.010, 0.09, 0.42  # m/N, m, m, for an arm of 1.5 m

COLOURS = {"truth": TRUE, "estimate": FELT, "candidate": CANDIDATE}
SHELL, TRIM, TINT = "#f1f2f4", "#5d646d", "#ffd39e"
SMALL = 420  # pixels; a picture up to this wide is small
MAP, SMALL_MAP = 512, 256  # pixels across the shadow map, and across that of a small picture
SKY, FLOOR = "#f8f9fb", "#e4e8ed"


def linear(colour: str) -> Floats:
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

    position: Floats
    force: Floats | None
    kind: str
    covariance: Floats | None
    label: str
    is_point: bool = True


class Scene:
    """A robot at a configuration, and what is to be drawn on it.

    Args:
        robot: the robot.
        q: (n,) joint positions [rad or m].
    """

    def __init__(self, robot: Robot, q: Floats) -> None:
        self.robot = robot
        self.q = np.array(q, float)
        self.marks: list[Mark] = []
        self._tints: dict[str, float] = {}
        self.pieces: tuple[Piece, ...] = robot_skin(robot)
        links = robot.T_world_links(self.q)
        self._poses = np.array([links[piece.link] for piece in self.pieces]).reshape(-1, 4, 4)
        self.posed = native_skin(robot).posed(np.ascontiguousarray(self._poses))

    @cached_property
    def surface(self) -> Triangles:
        """All triangles of the robot in world; `part` counts the pieces."""
        own = [p.triangles.moved(T) for p, T in zip(self.pieces, self._poses, strict=True)]
        return Triangles.joined(own)

    @cached_property
    def extent(self) -> float:
        """Length [m] of the diagonal of the box around the robot."""
        low, high = self.posed.box
        return float(np.linalg.norm(high - low)) if self.pieces else 1.0

    @cached_property
    def outline(self) -> Floats:
        """Points (N, 3) [m] of the robot that lie farthest out, in world."""
        parts = [
            piece.outline @ T[:3, :3].T + T[:3, 3]
            for piece, T in zip(self.pieces, self._poses, strict=True)
        ]
        return np.vstack(parts) if parts else np.zeros((0, 3))

    def normal_at(self, link: str, point: Floats) -> Floats | None:
        """Unit normal (3,) of a link's surface nearest to a point (3,) [m], both in world."""
        best, normal = np.inf, None
        for piece, T in zip(self.pieces, self._poses, strict=True):
            if piece.link != link or not len(piece.middles):
                continue
            away = np.linalg.norm(piece.middles - (point - T[:3, 3]) @ T[:3, :3], axis=1)
            nearest = int(away.argmin())
            if away[nearest] < best:
                best = away[nearest]
                normal = T[:3, :3] @ piece.triangles.normals[nearest].mean(axis=0)
        return None if normal is None else normal / np.linalg.norm(normal)

    @property
    def _unit(self) -> float:
        """Sizes of marks are those for an arm of 1.5 m times this."""
        return self.extent / 1.5

    def add_contact(
        self,
        position: Floats,
        force: Floats | None,
        kind: str = "estimate",
        covariance: Floats | None = None,
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

    def arrow(self, mark: Mark) -> tuple[Floats, Floats]:
        """Tail and tip (3,) [m] of a mark's arrow; the tip is the contact."""
        if mark.force is None:
            return mark.position, mark.position
        size = float(np.linalg.norm(mark.force))
        length = np.clip(FORCE_SCALE * size, SHORTEST, LONGEST) * self._unit
        return mark.position - mark.force / size * length, mark.position

    def points(self) -> Floats:
        """Points (N, 3) [m] that a picture should show: the robot and the arrows."""
        ends = [end for mark in self.marks for end in self.arrow(mark)]
        return np.vstack([self.outline, *ends])

    def render(self, camera: Camera, size: Size = (640, 640)) -> NDArray[np.uint8]:
        """The picture, (H, W, 3) in sRGB, of `size` (width, height) [pixels]."""
        canvas = _render.Canvas(self.posed, camera.eye, camera.axes, camera.focal, size)
        fine = MAP if max(size) > SMALL else SMALL_MAP
        layers = [
            (np.ascontiguousarray(t.corners, np.float64), t.normals, linear(tint), opacity)
            for t, tint, opacity in self._overlays()
        ]
        return canvas.image(self._albedo(), fine, linear(SKY), linear(FLOOR), layers)

    def _albedo(self) -> Floats:
        colours = []
        for piece in self.pieces:
            base = linear(TRIM if piece.trim else SHELL)
            strength = self._tints.get(piece.link, 0.0) * (0.55 if piece.trim else 1.0)
            colours.append(base + strength * (linear(TINT) - base))
        return np.array(colours).reshape(-1, 3)

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
