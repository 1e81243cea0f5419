# SPDX-License-Identifier: Apache-2.0
"""Widgets on the page: areas of the arm's surface, lit while pressed, and what is written there."""

import numpy as np
import trimesh
import viser
from numpy.typing import NDArray

from touchline.arrays import Array, Index
from touchline.localizer.skin import Patch
from touchline.touch.stroke import Stroke
from touchline.touch.touch import Press, Touch
from touchline.touch.widget import Widget

Colour = tuple[int, int, int]

REST: dict[str, Colour] = {
    "button": (86, 140, 190),
    "toggle": (150, 120, 190),
    "slider": (110, 160, 150),
    "dial": (110, 160, 150),
    "pad": (250, 246, 214),
}
LIT, INK, KNOB = (46, 170, 80), (30, 40, 110), (40, 80, 70)
EDGE = 0.004  # m, of the triangles that widgets are cut from
ABOVE = 0.003  # m over the surface, or it would be drawn through them
RADIUS = 0.009  # m, of a slider's knob
LONGEST = 200  # points of a stroke that are drawn: a browser makes all its lines anew each time
RENEWED = 100  # samples after which a stroke that grows is drawn again


class WidgetScene:
    """The widgets of an interface.

    Args:
        scene: of a viser server; the links' frames are at `/robot/LINK`.
        touch: whose widgets they are.
        patches: surfaces by link.
    """

    def __init__(self, scene: viser.SceneApi, touch: Touch, patches: dict[str, Patch]) -> None:
        self._scene = scene
        self._areas: dict[str, viser.MeshHandle] = {}
        self._knobs: dict[str, viser.IcosphereHandle] = {}
        self._ink: dict[str, viser.LineSegmentsHandle] = {}
        self._lit: dict[str, bool] = {}
        self._drawn: dict[str, Stroke | int] = {}  # a stroke that is over, or samples of a new one
        for name, widget in touch.widgets.items():
            if widget.link in patches and not widget.whole:
                self._add(name, widget, patches[widget.link])

    def _add(self, name: str, widget: Widget, patch: Patch) -> None:
        place = f"/robot/{widget.link}/widget/{name}"
        area = cut(widget, patch)
        if area is not None:
            colour = REST[widget.kind]
            self._areas[name] = self._scene.add_mesh_simple(
                f"{place}/area", *area, color=colour, side="double", cast_shadow=False
            )
        if widget.kind == "slider":
            self._knobs[name] = self._scene.add_icosphere(f"{place}/knob", RADIUS, KNOB)
            self._knobs[name].position = widget.point_at(0.0)
        if widget.kind == "pad":
            self._ink[name] = self._scene.add_line_segments(
                f"{place}/ink", np.zeros((1, 2, 3)), INK, thickness=4.0, thickness_units="screen"
            )

    @property
    def areas(self) -> dict[str, viser.MeshHandle]:
        """Handles of the drawn areas, by widget."""
        return self._areas

    def show(self, touch: Touch) -> None:
        """Lights what is pressed or switched on, moves knobs, and draws what is written."""
        pressed = {press.widget.name: press for press in touch.presses if press.widget is not None}
        for name, area in self._areas.items():
            lit = name in pressed or touch.values.get(name) is True
            if lit != self._lit.get(name, False):
                area.color = LIT if lit else REST[touch.widgets[name].kind]
                self._lit[name] = lit
        for name, knob in self._knobs.items():
            widget, value = touch.widgets[name], touch.values.get(name)
            if value is not None:
                low, high = widget.given.range
                knob.position = widget.point_at((value - low) / (high - low))
        for name, ink in self._ink.items():
            way = self._new_way(name, touch, pressed.get(name))
            if way is not None and len(way) > 1:
                ink.points = _ink(touch.widgets[name], way)

    def _new_way(self, name: str, touch: Touch, press: Press | None) -> Array | None:
        """The way (N, 2) of what is written on a pad, if it is not drawn yet."""
        before = self._drawn.get(name, 0)
        if press is not None:
            count = len(press.trace) // RENEWED
            if not count or count == before:
                return None
            self._drawn[name] = count
            return np.array(press.trace)[:, 1:3]
        last = next((s for s in reversed(touch.strokes) if s.widget == name), None)
        if last is None or last is before:
            return None
        self._drawn[name] = last
        return last.cleaned().points[:, 1:]


def _ink(widget: Widget, way: Array) -> NDArray[np.float32]:
    """Line segments (N, 2, 3) over a pad, in its link's frame."""
    u, v, n = widget.plane()
    way = way[:: -(-len(way) // LONGEST)]
    points = np.array(widget.given.at) + way @ np.array([u, v]) + 2.0 * ABOVE * n
    return np.stack([points[:-1], points[1:]], axis=1).astype(np.float32)


def cut(widget: Widget, patch: Patch) -> tuple[Array, Index] | None:
    """Vertices and faces of the part of a link's surface that is on a widget, a little above it.

    None where the widget is nowhere on the surface.
    """
    surface = patch.surface
    reach = widget.length / 2 if widget.kind == "slider" else 0.0
    reach += float(np.linalg.norm(widget.given.size or (2 * widget.reach,) * 2))
    middle = widget.point_at(0.5) if widget.kind == "slider" else np.array(widget.given.at)
    corners = surface.vertices[surface.faces]
    size = np.linalg.norm(np.ptp(corners, axis=1), axis=1)
    near = np.linalg.norm(corners.mean(axis=1) - middle, axis=1) < reach + size
    if not near.any():
        return None
    fine = trimesh.remesh.subdivide_to_size(
        surface.vertices, surface.faces[near], EDGE, max_iter=12
    )
    vertices, faces = fine[0], fine[1]
    middles = vertices[faces].mean(axis=1)
    normal = np.cross(
        vertices[faces[:, 1]] - vertices[faces[:, 0]], vertices[faces[:, 2]] - vertices[faces[:, 0]]
    )
    normal /= np.maximum(np.linalg.norm(normal, axis=1, keepdims=True), 1e-12)
    inside = np.array([widget.read(point).beyond < 0.0 for point in middles])
    if widget.kind in ("pad", "dial"):
        inside &= normal @ widget.plane()[2] > 0.0  # not the other side of the link
    if not inside.any():
        return None
    mesh = trimesh.Trimesh(vertices, faces[inside], process=True)
    raised = mesh.vertices + ABOVE * mesh.vertex_normals
    return np.asarray(raised, np.float64), np.asarray(mesh.faces, np.int64)
