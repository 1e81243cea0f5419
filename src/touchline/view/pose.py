# SPDX-License-Identifier: Apache-2.0
"""Orientations as the page wants them."""

import numpy as np

from touchline.arrays import Array


def quaternions(R: Array) -> Array:
    """Quaternions (N, 4), w x y z, of rotations (N, 3, 3)."""
    from scipy.spatial.transform import Rotation

    return np.roll(Rotation.from_matrix(R).as_quat(), 1, axis=-1)


def quaternion_to(direction: Array) -> Array:
    """The quaternion (4,) that turns the z axis to a direction (3,), by the shortest way."""
    unit = np.asarray(direction, float) / np.linalg.norm(direction)
    if unit[2] < -1.0 + 1e-9:
        return np.array([0.0, 1.0, 0.0, 0.0])
    wxyz = np.array([1.0 + unit[2], -unit[1], unit[0], 0.0])
    return wxyz / np.linalg.norm(wxyz)
