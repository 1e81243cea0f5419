# SPDX-License-Identifier: Apache-2.0
"""An image being drawn: what its samples show, and one layer over the other."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.report.render.camera import Camera, Size
from touchline.report.render.raster import rasterize, weights
from touchline.report.render.skin import Triangles

Array = NDArray[np.floating[Any]]

FINE = 2  # samples per pixel, along each side
NEAREST = 0.02  # m; triangles that come nearer to the camera are not drawn
HIDDEN = 0.30  # opacity of what the arm hides, relative to what it does not
ENCODED = (np.linspace(0, 1, 1 << 14) ** (1 / 2.2) * 255 + 0.5).astype(np.uint8)


@dataclass(frozen=True)
class Seen:
    """The samples (N,) of a canvas that show triangles, and what they show."""

    sample: NDArray[np.int64]
    part: NDArray[np.int64]
    depth: Array
    normal: Array
    position: Array


class Canvas:
    """An image being drawn, with FINE x FINE samples per pixel.

    Args:
        camera: that takes it.
        size: width and height [pixels].
    """

    def __init__(self, camera: Camera, size: Size) -> None:
        self._camera, self._size = camera, size
        self._fine = (size[0] * FINE, size[1] * FINE)
        self._depth: Array | None = None
        self._light: Array = np.zeros((size[0] * size[1], 3), np.float32)

    @property
    def image(self) -> NDArray[np.uint8]:
        """(H, W, 3) in sRGB."""
        steps = (self._light.clip(0, 1) * np.float32(len(ENCODED) - 1) + 0.5).astype(np.uint16)
        return ENCODED[steps].reshape(self._size[1], self._size[0], 3)

    def see(self, triangles: Triangles, closed: NDArray[np.bool_] | None = None) -> Seen:
        """Which samples show the triangles, nearest first; backs of closed ones are left out."""
        pixels, depth = self._camera.project(triangles.corners, self._fine)
        near = np.minimum(np.minimum(depth[:, 0], depth[:, 1]), depth[:, 2])
        shown = near > NEAREST
        if closed is not None:
            shown &= ~closed | (_turn(pixels) < 0)
        pixels, nearness = pixels[shown], 1 / depth[shown]
        hit = rasterize(pixels, nearness, self._fine)
        y, x = np.divmod(hit.pixel, self._fine[0])
        share = weights(pixels, nearness, hit.triangle, x + 0.5, y + 0.5)
        number, depth = np.flatnonzero(shown)[hit.triangle], 1 / hit.nearness
        normal = np.einsum("ni,nij->nj", share, triangles.normals[number])
        ray = self._camera.rays_at(x, y, self._fine)
        away = np.einsum("ij,ij->i", normal, ray) > 0
        if closed is None or not closed.all():
            normal[away] *= -1
        normal /= np.sqrt(np.einsum("ij,ij->i", normal, normal))[:, None]
        position = self._camera.eye + ray * depth[:, None]
        return Seen(hit.pixel, triangles.part[number], depth, normal, position)

    def put(self, ground: Array, seen: Seen, colour: Array) -> None:
        """Begin with a background (H, W, 3) and what stands before it."""
        self._light = ground.reshape(-1, 3).copy()
        self._blend(seen, colour, np.ones(len(colour), np.float32))

    def hides(self, seen: Seen) -> None:
        """What lies behind these samples is drawn fainter from now on."""
        self._depth = np.full(self._fine[0] * self._fine[1], np.inf, np.float32)
        self._depth[seen.sample] = seen.depth

    def put_over(self, seen: Seen, colour: Array, opacity: float) -> None:
        """Draw over it: fainter where it is hidden."""
        share = np.full(len(colour), opacity, np.float32)
        if self._depth is not None:
            share[self._depth[seen.sample] < seen.depth - 1e-4] *= HIDDEN
        self._blend(seen, colour, share)

    def _blend(self, seen: Seen, colour: Array, share: Array) -> None:
        y, x = np.divmod(seen.sample, self._fine[0])
        pixel = (y // FINE) * self._size[0] + x // FINE
        if not len(pixel):
            return
        low, high = int(pixel.min()), int(pixel.max()) + 1
        pixel = pixel - low
        cover = np.bincount(pixel, share, high - low) / FINE**2
        for i in range(3):
            added = np.bincount(pixel, share * colour[:, i].clip(0, 1), high - low) / FINE**2
            self._light[low:high, i] = self._light[low:high, i] * (1 - cover) + added


def _turn(corners: Array) -> Array:
    (x1, y1), (x2, y2) = ((corners[:, i] - corners[:, 0]).T for i in (1, 2))
    return x1 * y2 - x2 * y1
