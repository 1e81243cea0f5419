# SPDX-License-Identifier: Apache-2.0
"""Poses and inertias as matrices.

`T_ab` (4, 4) takes coordinates in b to coordinates in a; `R_ab` (3, 3) is its rotation.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from touchline.model.mechanism import Array, Inertia


def rotation_rpy(rpy: Sequence[float]) -> Array:
    """Return the rotation (3, 3) by roll, pitch, yaw [rad] about the fixed x, y, z axes (URDF)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def rpy_of(R: Array) -> list[float]:
    """Roll, pitch and yaw [rad] of a rotation; roll is 0 where only its sum with yaw counts."""
    flat = float(np.hypot(R[0, 0], R[1, 0]))
    pitch = float(np.arctan2(-R[2, 0], flat))
    if flat < 1e-9:
        return [0.0, pitch, float(np.arctan2(-R[0, 1], R[1, 1]))]
    return [float(np.arctan2(R[2, 1], R[2, 2])), pitch, float(np.arctan2(R[1, 0], R[0, 0]))]


def rotation_quaternion(wxyz: Sequence[float] | Array) -> Array:
    """Return the rotation (3, 3) of a quaternion w, x, y, z of any length but zero."""
    w, x, y, z = np.asarray(wxyz, float) / np.linalg.norm(wxyz)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def rotation_about(axis: Array, angle: float) -> Array:
    """Return the rotation (3, 3) by `angle` [rad] about the unit vector `axis` (Rodrigues)."""
    x, y, z = axis
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross


def rotation_to_axis(axis: NDArray[np.floating]) -> Array:
    """Return rotations (..., 3, 3) whose z columns are the unit vectors `axis` (..., 3).

    Their x columns are square to that world axis to which `axis` is squarest.
    """
    axis = np.asarray(axis, np.float64)
    squarest = np.eye(3)[np.argmin(np.abs(axis), axis=-1)]
    x = np.cross(squarest, axis)
    x /= np.linalg.norm(x, axis=-1, keepdims=True)
    return np.stack([x, np.asarray(np.cross(axis, x), float), axis], axis=-1)


def pose(R: Array | None = None, p: Sequence[float] | Array | None = None) -> Array:
    """Return the pose (4, 4) with rotation `R` (3, 3) and origin `p` (3,) [m]."""
    T = np.eye(4)
    if R is not None:
        T[:3, :3] = R
    if p is not None:
        T[:3, 3] = p
    return T


def pose_rpy(xyz: Sequence[float], rpy: Sequence[float]) -> Array:
    """Return the pose (4, 4) of a URDF `origin`: `xyz` [m] and `rpy` [rad]."""
    return pose(rotation_rpy(rpy), xyz)


def joint_motion(kind: str, axis: Array, position: float) -> Array:
    """Return the pose (4, 4) by which a joint at `position` [rad or m] moves its child."""
    if kind == "revolute":
        return pose(rotation_about(axis, position))
    return pose(p=axis * position) if kind == "prismatic" else np.eye(4)


def inertia_matrix(six: Sequence[float]) -> Array:
    """Return the matrix (3, 3) of ixx, ixy, ixz, iyy, iyz, izz [kg m2]."""
    ixx, ixy, ixz, iyy, iyz, izz = six
    return np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]], float)


def combine_inertias(bodies: Sequence[Inertia]) -> Inertia:
    """Return the mass properties of rigidly joined bodies, all in the same axes.

    The moments add about the common centre of mass by the parallel-axis theorem. Without any mass
    the centre is the origin.
    """
    mass = sum(body.mass for body in bodies)
    if mass == 0.0:
        return Inertia(0.0, np.zeros(3), np.sum([body.inertia for body in bodies], axis=0))
    com = np.sum([body.mass * body.com for body in bodies], axis=0) / mass
    inertia = np.sum(
        [body.inertia + _steiner(body.mass, body.com - com) for body in bodies], axis=0
    )
    return Inertia(mass, com, inertia)


def move_points(points: Array, T: Array) -> Array:
    """Return points (n, 3) [m], given in the axes of b, in the axes of a, with `T` = T_ab (4, 4).

    Its sums have one order on every processor: libraries of linear algebra each round in their own
    way, and of places that explain alike the last digit of a mesh chooses one.
    """
    x, y, z = points.T[:, :, np.newaxis]
    return x * T[:3, 0] + y * T[:3, 1] + z * T[:3, 2] + T[:3, 3]


def move_inertia(body: Inertia, T: Array) -> Inertia:
    """Return `body`, given in the axes of b, in the axes of a, with `T` = T_ab (4, 4)."""
    R = T[:3, :3]
    inertia = np.einsum("ij,jk,lk->il", R, body.inertia, R)  # in one order, as `move_points`
    return Inertia(body.mass, move_points(body.com[np.newaxis], T)[0], inertia)


def _steiner(mass: float, r: Array) -> Array:
    return mass * ((r * r).sum() * np.eye(3) - np.outer(r, r))  # in one order, as `move_points`


def move_wrench(T: Array) -> Array:
    """Return the matrix (6, 6) that moves wrenches from b to a, with `T` = T_ab (4, 4).

    Force by R, moment by R plus the lever p x (R f); momenta move alike.
    """
    R, (x, y, z) = T[:3, :3], T[:3, 3]
    X = np.zeros((6, 6))
    X[:3, :3] = X[3:, 3:] = R
    X[3:, :3] = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]) @ R
    return X
