# SPDX-License-Identifier: Apache-2.0
"""How surfaces and floor are lit: a key light that casts shadows, a fill and a head light."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.model.transforms import rotation_to_axis
from touchline.report.render.camera import Camera
from touchline.report.render.raster import box, rasterize

Array = NDArray[np.floating[Any]]

MAP, SMALL_MAP = 512, 256  # pixels across the shadow map, and across that of a small picture
TAPS = [(x, y) for x in (-3, -1, 1, 3) for y in (-3, -1, 1, 3)]  # pixels of it
SKY, GROUND = (0.56, 0.60, 0.66), (0.40, 0.38, 0.36)
KEY, FILL, HEAD = (0.86, 0.83, 0.78), (0.16, 0.18, 0.22), (0.16, 0.16, 0.16)


@dataclass(frozen=True)
class Lights:
    """Unit directions (3,) in world towards the lights and the viewer."""

    key: Array
    fill: Array
    eye: Array

    @staticmethod
    def of(camera: Camera) -> "Lights":
        """The key light from above and the left of the camera, the fill from its right."""
        right, up = camera.axes[0], np.array([0.0, 0.0, 1.0])
        near = np.cross(right, up)  # level, towards the camera
        key = -0.75 * right + 0.55 * near + 1.0 * up
        fill = 0.9 * right + 0.3 * near + 0.1 * up
        return Lights(key / np.linalg.norm(key), fill / np.linalg.norm(fill), -camera.axes[2])


class ShadowMap:
    """What a far light sees of triangles: where its light ends.

    Args:
        corners: (T, 3, 3) [m] in world.
        light: (3,) unit direction towards the light.
        width: of the map [pixels].
    """

    def __init__(self, corners: Array, light: Array, width: int = MAP) -> None:
        self._width = width
        self._axes = rotation_to_axis(light).T
        seen = corners @ self._axes.T
        low, high = box(seen)
        room = 0.08 * (high - low)[:2].max()
        self._low = np.append(low[:2] - room, low[2] - 1.0)  # heights begin at 1
        self._scale = self._width / ((high - low)[:2].max() + 2 * room)
        pixels = (seen[..., :2] - self._low[:2]) * self._scale
        hit = rasterize(pixels, seen[..., 2] - self._low[2], (self._width, self._width))
        self._height = np.zeros(self._width * self._width, np.float32)
        self._height[hit.pixel] = hit.nearness
        self._blurred: Array | None = None

    def lit(self, points: Array, normals: Array) -> Array:
        """Part (N,) of the key light that reaches points of the surface, soft at the borders."""
        step = 1.5 / self._scale
        faces = np.flatnonzero(normals @ self._axes[2] > 0)
        seen = (points[faces] + normals[faces] * step) @ self._axes.T - self._low
        column, row = (seen[:, :2] * self._scale).clip(4, self._width - 5).astype(np.int32).T
        cell, height = row * self._width + column, (seen[:, 2] + step).astype(np.float32)
        total = np.zeros(len(faces), np.float32)
        for x, y in TAPS:
            total += self._height.take(cell + (y * self._width + x)) < height
        lit = np.zeros(len(points), np.float32)
        lit[faces] = total / len(TAPS)
        return lit

    def shade_on_floor(self, points: Array) -> Array:
        """How much (N,) of the light the triangles keep from points below all of them."""
        if self._blurred is None:
            shaded = (
                (self._height > 0)
                .astype(np.float32)
                .reshape(self._width // 2, 2, self._width // 2, 2)
            )
            self._blurred = blur(shaded.mean(axis=(1, 3)), 2)
        place = points @ self._axes[:2].T - self._low[:2]
        return bilinear(self._blurred, place * (self._scale / 2))


def bilinear(image: Array, place: Array) -> Array:
    """Values (N,) of an image (H, W) at points (N, 2), x first; the border's beyond it."""
    height, width = image.shape
    x, y = (place - 0.5).T
    x, y = x.clip(0, width - 1.001), y.clip(0, height - 1.001)
    i, j = y.astype(np.int64), x.astype(np.int64)
    u, v = x - j, y - i
    top = image[i, j] * (1 - u) + image[i, j + 1] * u
    return top * (1 - v) + (image[i + 1, j] * (1 - u) + image[i + 1, j + 1] * u) * v


def doubled(image: Array) -> Array:
    """An image (H, W) at twice the size, interpolated linearly."""
    for _ in range(2):
        before, after = np.vstack([image[:1], image[:-1]]), np.vstack([image[1:], image[-1:]])
        pairs = np.stack([0.75 * image + 0.25 * before, 0.75 * image + 0.25 * after], axis=1)
        image = pairs.reshape(-1, image.shape[1]).T
    return image


def blur(image: Array, radius: int) -> Array:
    """An image (H, W) after three passes of a box of `radius`, which is nearly a Gaussian."""
    width = 2 * radius + 1
    for _ in range(3):
        for axis in (0, 1):
            edges = [(0, 0), (0, 0)]
            edges[axis] = (radius + 1, radius)
            total = np.cumsum(np.pad(image, edges), axis=axis, dtype=np.float64)
            total = np.moveaxis(total, axis, 0)
            image = np.moveaxis(total[width:] - total[:-width], 0, axis).astype(np.float32) / width
    return image


class FloorContact:
    """How near to the floor triangles are, as a soft darkness around where they stand."""

    REACH = 0.12  # m; what is higher above the floor darkens it little

    def __init__(self, corners: Array, floor: float) -> None:
        lowest = np.minimum(np.minimum(*corners[:, :2, 2].T), corners[:, 2, 2])
        corners = corners[lowest < floor + 4 * self.REACH]
        low, high = box(corners)
        room = 0.25 * (high - low)[:2].max() + 0.1
        self._low, self._scale = low[:2] - room, 192 / ((high - low)[:2].max() + 2 * room)
        above = corners[..., 2] - floor
        near = 1.0 / (1.0 + np.maximum(above, 0.0))
        hit = rasterize((corners[..., :2] - self._low) * self._scale, near, (192, 192))
        dark = np.zeros(192 * 192, np.float32)
        dark[hit.pixel] = np.exp(-(1 / hit.nearness - 1) / self.REACH)
        self._dark = blur(dark.reshape(192, 192), 6)

    def at(self, points: Array) -> Array:
        """Darkness (N,), 0 to 1, at points (N, 3) of the floor."""
        return bilinear(self._dark, (points[:, :2] - self._low) * self._scale)


def shaded(lights: Lights, normals: Array, albedo: Array, lit: Array | float = 1.0) -> Array:
    """Linear colours (N, 3) of points.

    Args:
        lights: of the picture.
        normals: (N, 3) unit normals in world.
        albedo: (N, 3) linear colours of the surface.
        lit: (N,) part of the key light that arrives.
    """
    up = 0.5 + 0.5 * normals[:, 2:]
    light = np.array(SKY) * up + np.array(GROUND) * (1 - up)
    key = (normals @ lights.key).clip(0) * lit
    fill = (0.5 + 0.5 * (normals @ lights.fill)).clip(0)
    head = (normals @ lights.eye).clip(0)
    light *= (0.55 + 0.45 * head)[:, None]  # grazing surfaces are darker: it tells the form
    light = light + key[:, None] * np.array(KEY)
    light += fill[:, None] * np.array(FILL) + head[:, None] * np.array(HEAD)
    half = lights.key + lights.eye
    half /= np.linalg.norm(half)
    gloss = (normals @ half).clip(0) ** 48 * lit * 0.22
    return (light * albedo * 0.77 + gloss[:, None]).astype(np.float32)
