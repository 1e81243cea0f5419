# SPDX-License-Identifier: Apache-2.0
"""Frames along a given axis."""

import numpy as np
from hypothesis import given
from hypothesis.extra.numpy import arrays
from hypothesis.strategies import floats

from touchline.model.transforms import rotation_to_axis

VECTORS = arrays(np.float64, (4, 3), elements=floats(-1.0, 1.0)).filter(
    lambda v: np.linalg.norm(v, axis=1).min() > 1e-6
)


@given(VECTORS)
def test_frames_are_right_handed_and_lie_along_their_axes(vectors):
    axes = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
    R = rotation_to_axis(axes)
    assert np.allclose(R[:, :, 2], axes) and np.allclose(np.linalg.det(R), 1.0)
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-12)
    assert np.array_equal(rotation_to_axis(axes[0]), R[0])
