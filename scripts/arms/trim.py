# SPDX-License-Identifier: Apache-2.0
"""Parts that are only drawn: caps and slits of pitch joints, rings of roll joints, the plate.

They stand at most a millimetre proud of the shells, which alone carry contacts.
"""

import numpy as np
import trimesh

from arms import kinematics as k
from arms.sdf import Array

SEGMENTS = 72
PROUD = 0.0008


def lathe(profile: list[tuple[float, float]], T_link_part: Array) -> trimesh.Trimesh:
    """A closed (radius, z) `profile`, counter-clockwise, turned about z and placed.

    A profile that touches the axis starts and ends there with radius 0.
    """
    angles = 2 * np.pi * np.arange(SEGMENTS) / SEGMENTS
    rings = np.array(
        [[(r * np.cos(a), r * np.sin(a), z) for a in angles] for r, z in profile]
    ).reshape(-1, 3)
    faces = []
    rows = len(profile)
    for i in range(rows):
        j = (i + 1) % rows
        for s in range(SEGMENTS):
            t = (s + 1) % SEGMENTS
            a, b = i * SEGMENTS + s, i * SEGMENTS + t
            c, d = j * SEGMENTS + s, j * SEGMENTS + t
            faces += [(a, b, d), (a, d, c)]
    mesh = trimesh.Trimesh(rings, faces, process=False)
    mesh.merge_vertices(digits_vertex=9)
    mesh.update_faces(mesh.nondegenerate_faces(height=1e-9))
    mesh.apply_transform(T_link_part)
    return mesh


def cap(radius: float, height: float, side: int) -> trimesh.Trimesh:
    """A cover on the pitch housing on the `side` of y, `height` above the link's origin."""
    knots = [(0.0, -0.002), (radius, -0.002), (radius, 0.0002), (radius - 0.0012, PROUD)]
    inner = 0.30 * radius
    knots += [(inner + 0.002, PROUD), (inner, 0.0001), (inner - 0.002, PROUD), (0.0, PROUD)]
    width = {k.P2: k.W2, k.P4: k.W4, k.P6: k.W6}[round(radius + 0.025, 6)]
    T = np.eye(4)
    T[:3, :3] = [[1, 0, 0], [0, 0, side], [0, -side, 0]]
    T[:3, 3] = 0.0, side * width, height
    return lathe(knots, T)


def ring(radius: float, low: float, high: float) -> trimesh.Trimesh:
    """A band around a round joint face, from `low` to `high`."""
    outer, inner = radius + PROUD, radius - 0.003
    bevel = 0.0006
    knots = [(inner, low), (outer - bevel, low), (outer, low + bevel)]
    knots += [(outer, high - bevel), (outer - bevel, high), (inner, high)]
    return lathe(knots, np.eye(4))


def filler(radius: float, axis: int, height: float) -> trimesh.Trimesh:
    """A disc that closes the slit of a joint about `axis` (1 or 2) at `height`."""
    half = 0.0032 if axis == 1 else 0.0016
    T = np.eye(4)
    if axis == 1:
        T[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    T[2, 3] = height
    return lathe([(0.0, -half), (radius, -half), (radius, half), (0.0, half)], T)


def plate() -> trimesh.Trimesh:
    """The plate under the base sensor, fixed to the ground."""
    top = k.MOUNT - 0.0012
    knots = [(0.0, 0.0), (0.134, 0.0), (0.134, 0.012), (0.131, 0.015), (0.118, 0.0155)]
    knots += [(0.117, 0.017), (0.117, top - 0.001), (0.116, top), (0.0, top)]
    return lathe(knots, np.eye(4))


def trims() -> dict[str, trimesh.Trimesh]:
    """The drawn parts by link."""
    e, f = 0.025, 0.006
    l0, l1, l2 = k.BASE_TO_ROLL_1, k.ROLL_1_TO_SHOULDER, k.SHOULDER_TO_ROLL_3
    l3, l4, l5 = k.ROLL_3_TO_ELBOW, k.ELBOW_TO_ROLL_5, k.ROLL_5_TO_WRIST
    l6, l7 = k.WRIST_TO_ROLL_7, k.ROLL_7_TO_FLANGE
    parts = {
        "base_mount": [plate()],
        "link0": [ring(k.R1, l0 - 0.017, l0 - 0.009), filler(k.R1 - f, 2, l0)],
        "link1": [cap(k.P2 - e, l1, -1), filler(k.P2 - f, 1, l1)],
        "link2": [cap(k.P2 - e, 0.0, 1), ring(k.R3, l2 - 0.015, l2 - 0.008)],
        "link3": [cap(k.P4 - e, l3, -1), filler(k.P4 - f, 1, l3)],
        "link4": [cap(k.P4 - e, 0.0, 1), ring(k.R5, l4 - 0.014, l4 - 0.008)],
        "link5": [filler(k.P6 - f, 1, l5)],
        "link6": [cap(k.P6 - e, 0.0, 1), filler(k.R7 - f, 2, l6)],
        "link7": [filler(k.R7 - f, 2, l7)],
    }
    parts["link2"].append(filler(k.R3 - f, 2, l2))
    parts["link4"].append(filler(k.R5 - f, 2, l4))
    return {name: trimesh.util.concatenate(meshes) for name, meshes in parts.items()}
