# SPDX-License-Identifier: Apache-2.0
"""Draws the arm, shaded, with forces on it; plain polygons, so that it needs no graphics card."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.model.surface import mechanism_surfaces

PLAIN, DARK = np.array([0.93, 0.935, 0.945]), np.array([0.50, 0.53, 0.57])
LIGHT = np.array([0.25, 0.5, 0.83])  # direction towards the light: right, towards us, up
AMBIENT = 0.62
ARROW = 0.006  # length of an arrow [m/N]


@dataclass(frozen=True)
class ArmView:
    """A parallel projection of the arm.

    Attributes:
        robot: whose visible surfaces are drawn.
        azimuth: of the direction from which it is seen, about the vertical [rad].
        elevation: of that direction over the horizon [rad].
        dark: links drawn in a darker grey.
    """

    robot: Robot
    azimuth: float = -1.1
    elevation: float = 0.25
    dark: tuple[str, ...] = ("tool", "handle", "base_mount")
    _surfaces: dict[str, Any] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        surfaces = mechanism_surfaces(self.robot.mechanism, "visual").by_link
        object.__setattr__(self, "_surfaces", surfaces)

    @property
    def R_view_world(self) -> Array:
        """Rows: to the right, away from us, and up on the paper (3, 3)."""
        a, e = self.azimuth, self.elevation
        towards = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        right = np.array([-np.sin(a), np.cos(a), 0.0])
        return np.stack([right, -towards, np.cross(towards, right)])

    def on_paper(self, points: ArrayLike) -> Array:
        """Places (..., 2) on the paper [m] of points (..., 3) in world."""
        return (np.asarray(points, float) @ self.R_view_world.T)[..., [0, 2]]

    def draw(self, axes: Any, q: Array, opacity: float = 1.0) -> None:
        """Draws the arm at `q` (n,) on axes without frame."""
        from matplotlib.collections import PolyCollection

        triangles, normals, base = self._triangles(q)
        facing = normals[:, 1] < 0
        triangles, normals, base = triangles[facing], normals[facing], base[facing]
        order = np.argsort(-triangles[:, :, 1].mean(axis=1))  # far ones first
        towards_light = LIGHT * [1, -1, 1] / np.linalg.norm(LIGHT)
        shade = AMBIENT + (1 - AMBIENT) * np.clip(normals @ towards_light, 0, 1)
        colors = np.clip(base * shade[:, None], 0, 1)[order]
        faces = PolyCollection(
            list(triangles[order][:, :, [0, 2]]),
            facecolors=colors,
            edgecolors=colors,  # closes the hairlines between neighbours
            linewidths=0.25,
            alpha=opacity,
            rasterized=True,
            zorder=2,
        )
        axes.add_collection(faces)
        axes.set_aspect("equal")
        axes.axis("off")

    def _triangles(self, q: Array) -> tuple[Array, Array, Array]:
        """Corners (F, 3, 3) and normals (F, 3) in the view, and colours (F, 3)."""
        poses, R = self.robot.T_world_links(q), self.R_view_world
        corners, normals, colors = [], [], []
        for link, surface in self._surfaces.items():
            T = poses[link]
            world = surface.vertices @ T[:3, :3].T + T[:3, 3]
            corners.append((world @ R.T)[surface.faces])
            normals.append(surface.normals @ (R @ T[:3, :3]).T)
            color = DARK if link in self.dark else PLAIN
            colors.append(np.tile(color, (len(surface.faces), 1)))
        return np.concatenate(corners), np.concatenate(normals), np.concatenate(colors)

    def frame(self, axes: Any, configurations: Array, margin: float = 0.12) -> None:
        """Sets limits in which the arm fits at all configurations (m, n)."""
        corners = np.concatenate(
            [self._triangles(q)[0].reshape(-1, 3)[:, [0, 2]] for q in configurations]
        )
        low, high = corners.min(axis=0) - margin, corners.max(axis=0) + margin
        axes.set_xlim(low[0], high[0])
        axes.set_ylim(low[1] + 0.8 * margin, high[1])

    def point(self, axes: Any, point: Array, color: str, size: float = 5.0) -> None:
        """Marks a point (3,) in world."""
        x, y = self.on_paper(point)
        axes.plot(x, y, "o", ms=size, mfc=color, mec="white", mew=0.6, zorder=6)

    def ring(self, axes: Any, point: Array, color: str, size: float = 9.0) -> None:
        """Marks a point (3,) in world by a ring, which another mark can stand in."""
        x, y = self.on_paper(point)
        axes.plot(x, y, "o", ms=size, mfc="none", mec=color, mew=0.9, zorder=5)

    def force(self, axes: Any, point: Array, force: Array, color: str) -> None:
        """An arrow that pushes into a point: force (3,) [N] at a point (3,), in world."""
        tail = self.on_paper(np.asarray(point) - ARROW * np.asarray(force))
        axes.annotate(
            "",
            xy=tuple(self.on_paper(point)),
            xytext=tuple(tail),
            arrowprops={
                "arrowstyle": "-|>,head_width=0.18,head_length=0.4",
                "color": color,
                "lw": 1.3,
                "shrinkA": 0,
                "shrinkB": 2.0,
            },
            zorder=4,
            annotation_clip=False,
        )
