# SPDX-License-Identifier: Apache-2.0
"""Where a picture is taken from: a pinhole camera."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Floats

Vector = Sequence[float] | Floats
Size = tuple[int, int]

FIELD_OF_VIEW = 0.42  # rad, vertical: long enough a lens that parallel lines look parallel
UP = (0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; the middle of the image looks along its axis.

    Attributes:
        eye: (3,) [m] in world.
        axes: (3, 3) rows in world: image right, image down, forward.
        focal: focal length in heights of the image.
    """

    eye: Floats
    axes: Floats
    focal: float

    @staticmethod
    def looking_at(
        target: Vector, eye: Vector, up: Vector = UP, field_of_view: float = FIELD_OF_VIEW
    ) -> "Camera":
        """A camera at `eye` (3,) [m] whose middle shows `target` (3,) [m], both in world.

        Args:
            target: what it looks at.
            eye: where it is.
            up: (3,) upwards in the image.
            field_of_view: of the image's height [rad].

        Raises:
            ValueError: eye and target are the same.
        """
        eye = np.asarray(eye, float)
        forward = np.asarray(target, float) - eye
        if not np.linalg.norm(forward) > 0:
            raise ValueError(f"eye {eye} is where the target is; it must be elsewhere")
        return Camera(eye, _axes(forward, up), 0.5 / float(np.tan(field_of_view / 2)))

    @staticmethod
    def framing(
        points: Floats,
        direction: Vector,
        aspect: float = 1.0,
        margin: float = 0.06,
        up: Vector = UP,
        field_of_view: float = FIELD_OF_VIEW,
    ) -> "Camera":
        """The nearest camera that looks against `direction` and has all points in the image.

        The four planes through the eye and the image's sides each bound the eye's position
        linearly, so this is exact.

        Args:
            points: (N, 3) [m] in world.
            direction: (3,) from the points to the camera.
            aspect: width of the image by its height.
            margin: part of the image left free on each side.
            up: (3,) upwards in the image.
            field_of_view: of the image's height [rad].
        """
        axes = _axes(-np.asarray(direction, float), up)
        height = np.tan(field_of_view / 2)
        x, y, z = axes @ np.asarray(points, float).T
        middle, distances = [], []
        for values, slope in ((x, height * aspect), (y, height)):
            slope = slope * (1 - 2 * margin)
            after, before = (values - slope * z).max(), (-values - slope * z).max()
            middle.append((after - before) / 2)
            distances.append(-(after + before) / (2 * slope))
        eye = np.array([*middle, min(distances)]) @ axes
        return Camera(eye, axes, 0.5 / float(height))

    def project(self, points: Floats, size: Size) -> tuple[Floats, Floats]:
        """Where points appear in an image.

        Args:
            points: (..., 3) [m] in world.
            size: width and height of the image [pixels].

        Returns:
            Pixels (..., 2), x to the right and y downwards from the outer corner of the first
            pixel, whose middle is (0.5, 0.5); and depth (...) along the axis [m].
        """
        seen = (np.asarray(points, float) - self.eye) @ self.axes.T
        depth = seen[..., 2]
        scale = self.focal * size[1] / depth
        pixels = seen[..., :2] * scale[..., None] + np.array(size) / 2
        return pixels, depth

    def rays(self, size: Size) -> Floats:
        """Directions (H * W, 3) in world through the middles of all pixels, of unit depth."""
        row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
        return self.rays_at(column, row, size)

    def rays_at(self, column: NDArray, row: NDArray, size: Size) -> Floats:
        """Directions (N, 3) in world through the middles of pixels, of unit depth."""
        scale = 1 / (self.focal * size[1])
        x, y = (column + (0.5 - size[0] / 2)) * scale, (row + (0.5 - size[1] / 2)) * scale
        right, down, forward = self.axes
        return np.stack([right[i] * x + down[i] * y + forward[i] for i in range(3)], axis=1)


def _axes(forward: Floats, up: Vector) -> Floats:
    """Rows right, down, forward; any right where `forward` is along `up`."""
    forward = forward / np.linalg.norm(forward)
    right = np.cross(forward, np.asarray(up, float))
    if np.linalg.norm(right) < 1e-6:
        right = np.cross(forward, np.roll(np.asarray(up, float), 1))
    right = right / np.linalg.norm(right)
    return np.array([right, np.cross(forward, right), forward])
