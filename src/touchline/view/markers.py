# SPDX-License-Identifier: Apache-2.0
"""Contacts on the page: point, force, line of action, and how sure the point is."""

from typing import Literal

import numpy as np
import trimesh
import viser

from touchline.arrays import Array
from touchline.figure import CANDIDATE, FELT, TRUE
from touchline.view.moments import METRES_PER_NEWTON
from touchline.view.pose import quaternion_to, quaternions

Colour = tuple[int, int, int]

COLOURS: dict[str, Colour] = {
    kind: (int(code[1:3], 16), int(code[3:5], 16), int(code[5:7], 16))
    for kind, code in (("estimate", FELT), ("truth", TRUE), ("candidate", CANDIDATE))
}
WEAK = 0.5  # N; a smaller force has no arrow
POINT_RADIUS, ARROW_RADIUS, HEAD_RADIUS, HEAD_LENGTH = 0.011, 0.008, 0.019, 0.045  # m
WIDE = 1.75  # of the truth, which is seen as an outline of what is felt
LINE = ((0.0, 0.0, -0.45), (0.0, 0.0, 0.45))  # m
SIGMAS = 2.0  # radius of the disc
SMALLEST_DISC, LARGEST_DISC, DISC_THICKNESS = 0.016, 0.4, 0.004  # m


class ContactMarker:
    """One contact; nothing is shown until `show` is called.

    The arrow ends where the force acts.

    Args:
        scene: of a viser server.
        name: of the marker in the scene.
        kind: "estimate", "truth" or "candidate", which are told apart by colour.
    """

    def __init__(self, scene: viser.SceneApi, name: str, kind: str = "estimate") -> None:
        colour = COLOURS[kind]
        self._root = scene.add_frame(name, show_axes=False, visible=False)
        self._arrow = scene.add_frame(f"{name}/arrow", show_axes=False)
        # Of the truth only the far side is drawn, so that it never hides what is felt.
        wide, side = (WIDE, "back") if kind == "truth" else (1.0, "front")
        self._point = _add(
            scene, f"{name}/point", trimesh.creation.icosphere(2, wide * POINT_RADIUS), colour, side
        )
        head = trimesh.creation.cone(wide * HEAD_RADIUS, HEAD_LENGTH, sections=24)
        head.apply_transform(np.diag([1.0, -1.0, -1.0, 1.0]))  # its tip at the origin, towards z
        shaft = trimesh.creation.cylinder(wide * ARROW_RADIUS, 1.0, sections=16)
        shaft.apply_translation((0.0, 0.0, -0.5))
        _add(scene, f"{name}/arrow/head", head, colour, side)
        self._shaft = _add(scene, f"{name}/arrow/shaft", shaft, colour, side)
        self._line = scene.add_line_segments(
            f"{name}/line", np.array([LINE]), colour, thickness=2.0, thickness_units="screen"
        )
        disc = trimesh.creation.cylinder(1.0, 1.0, sections=40)
        self._disc = _add(scene, f"{name}/disc", disc, colour, opacity=0.35)

    def show(
        self,
        position: Array,
        force: Array | None = None,
        covariance: Array | None = None,
        is_point: bool = True,
        line: bool = False,
    ) -> None:
        """Shows a contact.

        Args:
            position: (3,) [m] in world.
            force: (3,) [N] in world.
            covariance: (3, 3) [m2] of the position.
            is_point: whether the point is known; without, it only stands for the force.
            line: whether the line of action is drawn.
        """
        self._root.visible, self._root.position = True, position
        self._point.visible = is_point
        self._set_force(force, line)
        self._disc.visible = covariance is not None and is_point
        if covariance is not None and is_point:
            radii, turn = disc_of(covariance)
            self._disc.scale, self._disc.wxyz = (*radii, DISC_THICKNESS), turn

    def hide(self) -> None:
        """Shows nothing."""
        self._root.visible = False

    def _set_force(self, force: Array | None, line: bool) -> None:
        size = 0.0 if force is None else float(np.linalg.norm(force))
        self._arrow.visible = size > WEAK
        self._line.visible = line and size > WEAK
        if force is None or size <= WEAK:
            return
        self._arrow.wxyz = self._line.wxyz = quaternion_to(force)
        length = max(METRES_PER_NEWTON * size - HEAD_LENGTH, 1e-3)
        self._shaft.position = (0.0, 0.0, -HEAD_LENGTH)
        self._shaft.scale = (1.0, 1.0, length)


def _add(
    scene: viser.SceneApi,
    name: str,
    mesh: trimesh.Trimesh,
    colour: Colour,
    side: Literal["front", "back"] = "front",
    opacity: float | None = None,
) -> viser.MeshHandle:
    smooth = trimesh.graph.smooth_shade(mesh, angle=np.deg2rad(35.0))
    return scene.add_mesh_simple(
        name,
        np.asarray(smooth.vertices),
        np.asarray(smooth.faces),
        color=colour,
        side=side,
        opacity=opacity,
    )


def disc_of(covariance: Array) -> tuple[tuple[float, float], Array]:
    """Radii [m] and orientation (4,) of the disc that a point's covariance (3, 3) [m2] spans."""
    variances, axes = np.linalg.eigh(covariance)
    axes = np.column_stack([axes[:, 2], axes[:, 1], np.cross(axes[:, 2], axes[:, 1])])
    radii = SIGMAS * np.sqrt(np.maximum(variances[[2, 1]], 0.0))
    a, b = np.clip(radii, SMALLEST_DISC, LARGEST_DISC).tolist()
    return (a, b), quaternions(axes[None])[0]
