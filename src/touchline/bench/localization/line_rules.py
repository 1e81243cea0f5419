# SPDX-License-Identifier: Apache-2.0
"""What the line of force action alone says: the classical rules, to be measured beside ours."""

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.result.line import line_point


def first_entry(skin: Skin, q: Array, segment: str, wrench: Array) -> Array | None:
    """The first entry of a segment's line of force action into any of its links (the paper's rule).

    Args:
        skin: the robot's surfaces.
        q: joint positions (n,) [rad or m].
        segment: name of the segment.
        wrench: (6,) [N, Nm] on it, world axes, about the world origin.

    Returns:
        (3,) [m] in world; None where the line misses.
    """
    crossings = skin.crossings(q, line_point(wrench), wrench[:3], segment)
    return next((crossing.position for crossing in crossings if crossing.entry), None)


def nearest_to_line(skin: Skin, q: Array, segment: str, wrench: Array) -> Array | None:
    """The first entry, or the point of the surface that is nearest to the line where it misses."""
    entry = first_entry(skin, q, segment, wrench)
    if entry is not None:
        return entry
    poses = skin.robot.poses(q)
    origin, direction = line_point(wrench), wrench[:3] / np.linalg.norm(wrench[:3])
    best, least = None, np.inf
    for patch in skin.patches:
        if patch.segment != segment:
            continue
        R, p = poses[patch.node][:3, :3], poses[patch.node][:3, 3]
        distance, face, *point = patch.mesh.nearest_to_line(R.T @ (origin - p), R.T @ direction)[
            0, :5
        ]
        if face >= 0 and distance < least:
            best, least = R @ np.array(point) + p, distance
    return best
