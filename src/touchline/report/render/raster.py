# SPDX-License-Identifier: Apache-2.0
"""Which triangle each pixel shows: a z-buffer filled row by row, without a loop over triangles."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]
Index = NDArray[np.int64]

SHIFT = np.uint64(32)


@dataclass(frozen=True)
class Raster:
    """The pixels of an image that show a triangle.

    Attributes:
        pixel: (N,) row * width + column, increasing.
        triangle: (N,) number of the nearest triangle.
        nearness: (N,) interpolated nearness there.
    """

    pixel: Index
    triangle: Index
    nearness: NDArray[np.float32]


def rasterize(corners: Array, nearness: Array, size: tuple[int, int]) -> Raster:
    """Find the nearest triangle at the middle of each pixel.

    Args:
        corners: (T, 3, 2) in pixels, either way round.
        nearness: (T, 3) > 0 and linear in the image: 1 / depth for a pinhole camera.
        size: width and height [pixels].
    """
    low, window = _window(corners, size)
    pixel, key = _fragments(corners - low, nearness, *window)
    buffer = np.zeros(window[0] * window[1], np.uint64)
    np.maximum.at(buffer, pixel, key)
    hit = np.flatnonzero(buffer)
    best = buffer[hit]
    triangle = len(corners) - (best & np.uint64(0xFFFFFFFF)).astype(np.int64)
    row, column = np.divmod(hit, max(window[0], 1))
    pixel = (row + low[1]) * size[0] + column + low[0]
    return Raster(pixel, triangle, (best >> SHIFT).astype(np.uint32).view(np.float32))


def box(points: Array) -> tuple[Array, Array]:
    """Return the least and the largest coordinates (d,) of points (..., d).

    Column by column, which is several times faster than along the first axis.
    """
    columns = [points[..., i] for i in range(points.shape[-1])]
    return np.array([c.min() for c in columns]), np.array([c.max() for c in columns])


def _window(corners: Array, size: tuple[int, int]) -> tuple[Index, tuple[int, int]]:
    """Return the first pixel (2,) and the size of the part of an image that triangles touch."""
    if not len(corners):
        return np.zeros(2, np.int64), (0, 0)
    least, largest = box(corners)
    low = np.floor(least.clip(0, size)).astype(np.int64)
    high = np.ceil(largest.clip(0, size)).astype(np.int64)
    return low, (int(high[0] - low[0]), int(high[1] - low[1]))


def _fragments(
    corners: Array, nearness: Array, width: int, height: int
) -> tuple[Index, NDArray[np.uint64]]:
    """Return all pixels of all triangles, each with a key that is larger the nearer it is."""
    triangle, row = _rows(corners[:, :, 1], height)
    low, high = _row_ends(corners, triangle, row + 0.5)
    first = np.ceil(low - 0.5).clip(0, width).astype(np.int64)
    last = np.ceil(high - 0.5).clip(0, width).astype(np.int64)
    count = np.maximum(last - first, 0)
    along, down = _slopes(corners, nearness)
    x, y = first + 0.5 - corners[triangle, 0, 0], row + 0.5 - corners[triangle, 0, 1]
    start = nearness[triangle, 0] + along[triangle] * x + down[triangle] * y

    ends = np.cumsum(count)
    step = np.arange(ends[-1] if len(ends) else 0) - np.repeat(ends - count, count)
    value = np.repeat(start, count) + np.repeat(along[triangle], count) * step
    bits = np.maximum(value, 1e-30).astype(np.float32).view(np.uint32).astype(np.uint64)
    number = np.repeat((len(corners) - triangle).astype(np.uint64), count)
    return np.repeat(row * width + first, count) + step, (bits << SHIFT) | number


def _rows(y: Array, height: int) -> tuple[Index, Index]:
    """Return (triangle, row) for each row of pixels whose middle a triangle spans."""
    least = np.minimum(np.minimum(y[:, 0], y[:, 1]), y[:, 2])
    largest = np.maximum(np.maximum(y[:, 0], y[:, 1]), y[:, 2])
    first = np.ceil(least - 0.5).clip(0, height).astype(np.int64)
    last = np.ceil(largest - 0.5).clip(0, height).astype(np.int64)
    count = np.maximum(last - first, 0)
    triangle = np.repeat(np.arange(len(y)), count)
    row = np.arange(len(triangle)) - np.repeat(np.cumsum(count) - count - first, count)
    return triangle, row


def _row_ends(corners: Array, triangle: Index, y: Array) -> tuple[Array, Array]:
    """Return where rows at heights `y` enter and leave their triangles.

    An edge's line is the same to the last bit from both of its triangles, so that a surface
    has neither cracks nor pixels drawn twice.
    """
    turn = np.sign(_area(corners))
    low = np.full(len(y), -np.inf)
    high = np.where(turn[triangle] == 0, -np.inf, np.inf)  # no area, no pixels
    for i in range(3):
        (x0, y0), (x1, y1) = corners[:, i].T, corners[:, (i + 1) % 3].T
        rise = y0 - y1
        level = np.where(rise == 0, np.inf, rise)  # bounds no row; its offset is not used
        slope, offset = -(x1 - x0) / level, -(x0 * y1 - x1 * y0) / level
        at = slope[triangle] * y + offset[triangle]
        side = (turn * rise)[triangle]
        low = np.where(side > 0, np.maximum(low, at), low)
        high = np.where(side < 0, np.minimum(high, at), high)
    return low, high


def _area(corners: Array) -> Array:
    """Return twice the signed area (T,)."""
    (x1, y1), (x2, y2) = ((corners[:, i] - corners[:, 0]).T for i in (1, 2))
    return x1 * y2 - x2 * y1


def _slopes(corners: Array, values: Array) -> tuple[Array, Array]:
    """Return the change of a linear function per pixel along x and y; 0 without an area."""
    (x1, y1), (x2, y2) = ((corners[:, i] - corners[:, 0]).T for i in (1, 2))
    v1, v2 = values[:, 1] - values[:, 0], values[:, 2] - values[:, 0]
    area = x1 * y2 - x2 * y1
    inverse = np.divide(1.0, area, out=np.zeros_like(area), where=np.abs(area) > 1e-12)
    return (v1 * y2 - v2 * y1) * inverse, (x1 * v2 - x2 * v1) * inverse


def weights(corners: Array, nearness: Array, triangle: Index, x: Array, y: Array) -> Array:
    """Return the perspective-correct weights (N, 3) of the corners at points of triangles.

    Args:
        corners: (T, 3, 2) in pixels.
        nearness: (T, 3) 1 / depth.
        triangle: (N,) numbers of triangles.
        x: (N,) in pixels.
        y: (N,) in pixels.
    """
    p = corners[triangle]
    parts = []
    for i in range(3):
        a, b = p[:, (i + 1) % 3], p[:, (i + 2) % 3]
        part = (b[:, 0] - a[:, 0]) * (y - a[:, 1]) - (b[:, 1] - a[:, 1]) * (x - a[:, 0])
        parts.append(part * nearness[triangle, i])
    stacked = np.stack(parts, axis=1)
    return stacked / stacked.sum(axis=1, keepdims=True)
