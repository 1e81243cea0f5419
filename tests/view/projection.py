# SPDX-License-Identifier: Apache-2.0
"""Where a point of the world stands in the window, from the camera that the page reports."""

import numpy as np
import viser
from scipy.spatial.transform import Rotation


def pixel(camera: viser.CameraHandle, point) -> tuple[float, float]:
    """Column and row of a point (3,) in world; the camera looks along its z, y points down."""
    R = Rotation.from_quat(np.roll(camera.wxyz, -1)).as_matrix()
    x, y, z = R.T @ (np.asarray(point, float) - camera.position)
    assert z > 0, "behind the camera"
    focal = camera.image_height / 2 / np.tan(camera.fov / 2)
    return camera.image_width / 2 + focal * x / z, camera.image_height / 2 + focal * y / z


def count_near(image: np.ndarray, column: float, row: float, colour, radius: int = 4) -> int:
    """How many pixels about a place have a colour's hue: its order of channels, and clearly so."""
    r, c = round(row), round(column)
    patch = image[r - radius : r + radius + 1, c - radius : c + radius + 1].astype(float)
    wanted = np.asarray(colour, float) - np.mean(colour)
    shown = patch - patch.mean(axis=-1, keepdims=True)
    length = np.linalg.norm(shown, axis=-1)
    alike = shown @ wanted / np.maximum(length, 1e-9) / np.linalg.norm(wanted)
    return int(np.sum((alike > 0.93) & (length > 30.0)))
