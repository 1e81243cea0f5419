# SPDX-License-Identifier: Apache-2.0
"""Lines and points against surfaces, beside brute force."""

import numpy as np
import pytest
import trimesh

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.native import core


def native(mesh):
    return core.mesh(
        np.ascontiguousarray(mesh.vertices, float), np.ascontiguousarray(mesh.faces, np.int64)
    )


@pytest.fixture(scope="module", params=["sphere", "torus", "soup"])
def mesh(request):
    if request.param == "sphere":
        return trimesh.creation.icosphere(subdivisions=3, radius=0.1)
    if request.param == "torus":
        return trimesh.creation.torus(0.1, 0.03)
    rng = np.random.default_rng(1)
    vertices = rng.normal(size=(600, 3)) * 0.1
    return trimesh.Trimesh(vertices, rng.integers(0, 600, (800, 3)), process=False)


def random_line(rng):
    direction = rng.normal(size=3)
    return rng.normal(size=3) * 0.08, direction / np.linalg.norm(direction)


def crossed(triangles, origin, direction):
    """Where a line goes through triangles: the edges must all pass it on the same side."""
    a, b, c = (corner - origin for corner in triangles.transpose(1, 0, 2))
    sides = [np.cross(p, q) @ direction for p, q in ((a, b), (b, c), (c, a))]
    through = np.all(np.array(sides) > 0, axis=0) | np.all(np.array(sides) < 0, axis=0)
    normal = np.cross(b - a, c - a)[through]
    return np.einsum("ij,ij->i", a[through], normal) / (normal @ direction)


def test_a_line_meets_every_triangle_that_brute_force_says(mesh):
    rng, tree = np.random.default_rng(0), native(mesh)
    total = 0
    for _ in range(60):
        origin, direction = random_line(rng)
        ours = np.sort(tree.crossings(origin, direction)[:, 0])
        theirs = np.sort(crossed(mesh.triangles, origin, direction))
        np.testing.assert_allclose(ours, theirs, atol=1e-9)
        total += len(ours)
    assert total > 50


def test_a_line_through_a_vertex_or_an_edge_does_not_slip_through():
    cube = trimesh.creation.box((2.0, 2.0, 2.0))
    tree = native(cube)
    for through in ([1.0, 1.0, 1.0], [1.0, 1.0, 0.3], [1.0, 0.0, 0.0], [0.5, 0.5, 1.0]):
        target = np.array(through)
        direction = np.array([0.3, 0.2, 0.9]) if through[2] == 0.3 else target
        rows = tree.crossings(target, direction)
        assert (np.abs(rows[:, 0]) < 1e-9).any()


def test_the_point_nearest_to_a_line_is_that_of_brute_force(mesh):
    rng, tree = np.random.default_rng(2), native(mesh)
    samples = dense_edges(mesh)
    misses = 0
    for _ in range(60):
        origin, direction = random_line(rng)
        origin = origin * 4
        row = tree.nearest_to_line(origin, direction)[0]
        assert to_line(row[2:5][None], origin, direction)[0] == pytest.approx(row[0], abs=1e-9)
        if len(tree.crossings(origin, direction)):
            assert row[0] == 0.0
            continue
        misses += 1
        brute = to_line(samples, origin, direction).min()
        assert row[0] <= brute + 1e-12
        assert row[0] == pytest.approx(brute, abs=2e-3)
    assert misses > 10


def test_the_point_nearest_to_a_point_is_that_of_trimesh(mesh):
    rng, tree = np.random.default_rng(3), native(mesh)
    points = rng.normal(size=(80, 3)) * 0.15
    triangles = mesh.triangles
    for point in points:
        row = tree.nearest_to_point(point)[0]
        on = trimesh.triangles.closest_point(triangles, np.tile(point, (len(triangles), 1)))
        assert row[0] == pytest.approx(np.linalg.norm(on - point, axis=1).min(), abs=1e-9)


def dense_edges(mesh):
    a, b, c = mesh.triangles.transpose(1, 0, 2)
    steps = np.linspace(0, 1, 30)[:, None, None]
    return np.concatenate([p + steps * (q - p) for p, q in ((a, b), (b, c), (c, a))]).reshape(-1, 3)


def to_line(points, origin, direction):
    beside = points - origin
    return np.linalg.norm(beside - np.outer(beside @ direction, direction), axis=1)


def test_the_skin_of_an_arm_stands_where_its_links_stand():
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    q = np.linspace(-1, 1, len(robot.joint_names))
    poses = robot.T_world_links(q)
    rng = np.random.default_rng(4)
    for patch in skin.patches:
        v, T = patch.surface.vertices, poses[patch.link]
        inside = T[:3, :3] @ (v.mean(axis=0)) + T[:3, 3]
        face = patch.surface.faces[rng.integers(len(patch.surface.faces))]
        middle = T[:3, :3] @ v[face].mean(axis=0) + T[:3, 3]
        distance, place = skin.nearest(q, patch.link, middle)
        assert distance < 1e-9
        np.testing.assert_allclose(place, middle, atol=1e-9)
        found = skin.crossings(q, inside, middle - inside)
        own = [c.distance for c in found if c.link == patch.link]
        assert np.abs(np.array(own) - np.linalg.norm(middle - inside)).min() < 1e-7


def test_a_mesh_that_names_a_missing_vertex_is_refused():
    with pytest.raises(ValueError, match="vertex"):
        core.mesh(np.zeros((3, 3)), np.array([[0, 1, 3]]))
