# SPDX-License-Identifier: Apache-2.0
"""The committed meshes: closed, fine enough, on the shapes of the script, clear of each other."""

import numpy as np
import pytest
import trimesh
from arms import kinematics
from arms.sdf import gradient
from arms.shapes import shells as make_fields
from conftest import poses

FIELDS = {name: shell.field for name, shell in make_fields().items()}
LINKS = sorted(FIELDS)
HOME = np.array([0.0, 0.45, 0.0, 1.45, 0.0, 1.2416, 0.0])


@pytest.mark.parametrize("name", LINKS)
def test_shell_is_closed_and_faces_outwards(shells, name):
    mesh = shells[name]
    assert mesh.is_watertight and mesh.is_winding_consistent and mesh.volume > 0
    assert len(mesh.faces) >= 2000
    assert mesh.euler_number == (0 if name == "handle" else 2)  # the grip is a ring
    outwards = gradient(FIELDS[name], mesh.triangles_center)
    outwards /= np.linalg.norm(outwards, axis=1, keepdims=True)
    assert ((outwards * mesh.face_normals).sum(axis=1) > 0.7).all()


@pytest.mark.parametrize("name", LINKS)
def test_shell_lies_on_the_shape_of_the_script(shells, name):
    mesh = shells[name]
    assert np.abs(FIELDS[name](np.asarray(mesh.vertices))).max() < 2e-5
    assert np.abs(FIELDS[name](mesh.triangles_center)).max() < 1e-3
    assert np.degrees(np.percentile(mesh.face_angles.min(axis=1), 5)) > 8


def test_everything_stays_under_three_megabytes(robots):
    assert sum(p.stat().st_size for p in robots.rglob("*") if p.is_file()) < 3_000_000


def overlap(shells, T, a, b):
    """How deep points of link `a` are inside link `b` [m]; negative: they are not."""
    relative = np.linalg.inv(T[b]) @ T[a]
    points = np.vstack([shells[a].vertices, shells[a].triangles_center])
    return -FIELDS[b](trimesh.transform_points(points, relative)).min()


@pytest.mark.parametrize("q", [HOME, np.zeros(7)], ids=["home", "stretched"])
def test_links_do_not_intersect(shells, q):
    T = poses(q)
    for a in LINKS:
        for b in LINKS:
            assert a == b or overlap(shells, T, a, b) < 0, f"{a} is inside {b}"


@pytest.mark.parametrize("joint", [1, 3, 5])
@pytest.mark.parametrize("share", [-1.0, -0.8, 0.5, 1.0])
def test_pitch_joints_fold_to_their_limits(shells, joint, share):
    q = np.zeros(7)
    q[joint] = share * kinematics.FOLD
    T, pair = poses(q), (f"link{joint}", f"link{joint + 1}")
    assert overlap(shells, T, *pair) < 0 and overlap(shells, T, *pair[::-1]) < 0


def test_a_hand_fits_into_the_handle():
    half = np.array([0.015, 0.044, 0.020])  # fingers: 30 x 88 x 40 mm
    grid = np.stack(np.meshgrid(*[np.linspace(-h, h, 9) for h in half]), axis=-1).reshape(-1, 3)
    assert FIELDS["handle"](grid + [0, 0, 0.0475]).min() > 0.001
