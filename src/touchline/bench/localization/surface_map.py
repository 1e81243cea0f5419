# SPDX-License-Identifier: Apache-2.0
"""An arm coloured by values that are known at points of its surface."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from touchline import _render
from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.report.render.camera import Camera, Size
from touchline.report.render.skin import smooth

NEIGHBOURS = 12  # points whose values make up the colour of a place
MAP = 512  # pixels across the shadow map
UNKNOWN = (0.6, 0.6, 0.62)


class SurfaceMap:
    """Values at points of the links, spread over their surfaces.

    Args:
        skin: the robot's surfaces.
        links: (m,) names of the links that carry the points.
        points: (m, 3) [m] in the links' frames.
        values: (m,) of any unit; positive.
    """

    def __init__(self, skin: Skin, links: Sequence[str], points: Array, values: Array) -> None:
        self._skin, self._links = skin, np.array(list(links), dtype=object)
        self._points, self._values = np.asarray(points, float), np.asarray(values, float)

    def at(self, link: str, places: Array, share: float = 0.5) -> Array:
        """Values (N,) at places (N, 3) [m] in a link's frame: a quantile of the nearest points'.

        NaN on a link without points.
        """
        from scipy.spatial import KDTree  # slow to import

        own = np.flatnonzero(self._links == link)
        if not len(own):
            return np.full(len(places), np.nan)
        count = min(NEIGHBOURS, len(own))
        _, near = KDTree(self._points[own]).query(places, count)
        return np.quantile(self._values[own][near.reshape(-1, count)], share, axis=1)

    def render(self, q: Array, camera: Camera, size: Size, ends: tuple[float, float]) -> NDArray:
        """The arm at joint positions `q` (n,), an image (H, W, 3) in sRGB.

        Args:
            q: joint positions (n,) [rad or m].
            camera: that takes it.
            size: width and height [pixels].
            ends: values of the two ends of the colours, on a logarithmic scale.
        """
        poses = self._skin.robot.T_world_links(q)
        patches = self._skin.patches
        smoothed = [smooth(patch.surface) for patch in patches]
        native = _render.Skin(
            [(np.ascontiguousarray(t.corners, np.float64), t.normals, False) for t in smoothed]
        )
        posed = native.posed(np.array([poses[patch.link] for patch in patches]))
        canvas = _render.Canvas(posed, camera.eye, camera.axes, camera.focal, size)
        part, position = canvas.part, canvas.position
        albedo = np.empty((len(part), 3))
        for i, patch in enumerate(patches):
            mine = part == i
            T = poses[patch.link]
            albedo[mine] = self._colours(patch.link, (position[mine] - T[:3, 3]) @ T[:3, :3], ends)
        return canvas.image(albedo, MAP, np.ones(3), None, [])

    def _colours(self, link: str, places: Array, ends: tuple[float, float]) -> Array:
        if not len(places):
            return np.empty((0, 3))
        values = self.at(link, places)
        low, high = np.log(ends)
        known = np.isfinite(values)
        out = np.tile(np.array(UNKNOWN), (len(places), 1))
        share = (np.log(np.maximum(values[known], 1e-9)) - low) / (high - low)
        out[known] = colours(share) ** 2.2
        return out


def colours(share: Array) -> Array:
    """SRGB (N, 3) from 0, dark blue, to 1, yellow (matplotlib's viridis)."""
    from matplotlib import colormaps

    return colormaps["viridis"](np.clip(share, 0.0, 1.0))[:, :3]


def framing(skin: Skin, q: Array, size: Size, direction: tuple[float, float, float]) -> Camera:
    """A camera that shows the whole arm at `q` (n,) from a direction."""
    poses = skin.robot.T_world_links(q)
    corners = [
        patch.surface.vertices @ poses[patch.link][:3, :3].T + poses[patch.link][:3, 3]
        for patch in skin.patches
    ]
    return Camera.framing(np.vstack(corners), direction, size[0] / size[1])
