# SPDX-License-Identifier: Apache-2.0
import struct

import numpy as np
import pytest

from touchline.model.loading import load_mechanism
from touchline.model.mechanism import Geometry, Inertia, Link
from touchline.model.mesh_file import MeshError, read_mesh
from touchline.model.surface import link_surface, mechanism_surfaces
from touchline.model.tessellation import box
from touchline.model.transforms import pose_rpy
from touchline.model.urdf import load_urdf

T = pose_rpy((0.1, 0.2, 0.3), (0.4, 0.5, 0.6))
COLLADA = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="millimeter" meter="0.001"/><up_axis>Y_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>
<source id="p"><float_array id="pa" count="12">0 0 0 100 0 0 0 200 0 0 0 300</float_array>
<technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 1 3 0 3 2 1 2 3</p></triangles></mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node id="n"><translate>10 0 0</translate>
<instance_geometry url="#g"/></node></visual_scene></library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene></COLLADA>
"""
TETRAHEDRON = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
TETRAHEDRON_FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def link(*shapes, visual=()):
    return Link("a", Inertia.zero(), tuple(shapes), tuple(visual))


def volume(surface):
    a, b, c = surface.vertices[surface.faces].transpose(1, 0, 2)
    return np.einsum("ij,ij->", a, np.cross(b, c)) / 6


@pytest.mark.parametrize(
    ("kind", "size", "exact_volume", "exact_area"),
    [
        ("box", (0.1, 0.2, 0.3), 0.006, 0.22),
        ("sphere", (0.1,), 4 / 3 * np.pi * 1e-3, 4 * np.pi * 1e-2),
        ("cylinder", (0.1, 0.5), np.pi * 5e-3, 0.12 * np.pi),
        ("capsule", (0.1, 0.5), np.pi * (5e-3 + 4e-3 / 3), np.pi * (0.1 + 0.04)),
        ("ellipsoid", (0.1, 0.2, 0.3), 4 / 3 * np.pi * 6e-3, None),
    ],
)
def test_primitives(kind, size, exact_volume, exact_area):
    surface = link_surface(link(Geometry(kind, T, size)))
    assert surface.closed
    assert surface.warnings == ()
    assert exact_volume * 0.985 < volume(surface) <= exact_volume * (1 + 1e-12)
    if exact_area:
        assert surface.areas.sum() == pytest.approx(exact_area, rel=0.01)
    # The shapes are convex: outward means away from the middle, for every face.
    middle = surface.vertices[surface.faces].mean(axis=1) - T[:3, 3]
    assert (np.einsum("ij,ij->i", middle, surface.normals) > 0).all()
    np.testing.assert_allclose(np.linalg.norm(surface.normals, axis=1), 1)


def test_capsule_is_about_its_axis():
    surface = link_surface(link(Geometry("capsule", np.eye(4), (0.1, 0.5))))
    np.testing.assert_allclose(np.ptp(surface.vertices, axis=0), [0.2, 0.2, 0.7])
    # Each vertex is 0.1 from the segment between the centres of the two ends.
    beyond = np.maximum(abs(surface.vertices[:, 2]) - 0.25, 0)
    radius = np.hypot(np.hypot(surface.vertices[:, 0], surface.vertices[:, 1]), beyond)
    np.testing.assert_allclose(radius, 0.1)


def write_mesh(tmp_path, suffix):
    corners = TETRAHEDRON[TETRAHEDRON_FACES]
    path = tmp_path / f"m{suffix}"
    if suffix == ".obj":
        lines = [f"v {x} {y} {z}" for x, y, z in TETRAHEDRON]
        lines += [f"f {a} {b} {c}" for a, b, c in TETRAHEDRON_FACES + 1]
        path.write_text("mtllib gone.mtl\nusemtl gone\n" + "\n".join(lines))
    elif suffix == ".stl":
        facets = b"".join(struct.pack("<12fH", 0, 0, 0, *c.ravel(), 0) for c in corners)
        # Some exporters write binary files that begin like text.
        path.write_bytes(b"solid binary".ljust(80) + struct.pack("<I", 4) + facets)
    elif suffix == ".dae":
        pytest.importorskip("collada")
        path.write_text(COLLADA)
    else:
        path = tmp_path / "ascii.stl"
        loops = ("\n".join(f"vertex {x} {y} {z}" for x, y, z in c) for c in corners)
        facet = "facet normal 0 0 0\nouter loop\n{}\nendloop\nendfacet\n"
        path.write_text("solid a b\n" + "".join(map(facet.format, loops)) + "endsolid\n")
    return path


@pytest.mark.parametrize("suffix", [".obj", ".stl", "ascii", ".dae"])
@pytest.mark.parametrize("scale", [(1, 1, 1), (1, 2, -3), (-1, -1, -1), (-2, -2, 1)])
def test_mesh_formats_and_scales(tmp_path, suffix, scale):
    path = write_mesh(tmp_path, suffix)
    mesh = Geometry("mesh", T, path=str(path), scale=scale)
    surface = link_surface(link(mesh))
    assert surface.closed
    assert len(surface.vertices) == 4  # an STL's repeated corners are merged
    assert volume(surface) == pytest.approx(1e-3 * abs(np.prod(scale)), rel=1e-6)
    # COLLADA: millimetres are applied, the node's translation too, the up axis is not.
    shift = [0.01, 0, 0] if suffix == ".dae" else [0, 0, 0]
    expected = (TETRAHEDRON + shift) * scale @ T[:3, :3].T + T[:3, 3]
    distance = np.linalg.norm(expected[:, None] - surface.vertices[None], axis=2)
    assert distance.min(axis=1).max() < 1e-7


def test_inside_out_mesh_is_turned():
    vertices, faces = box(np.ones(3))
    shape = Geometry("triangles", np.eye(4), vertices=vertices, faces=faces[:, ::-1])
    surface = link_surface(link(shape))
    assert volume(surface) == pytest.approx(1)


def test_open_mesh_is_a_warning():
    vertices, faces = box(np.ones(3))
    shape = Geometry("triangles", np.eye(4), vertices=vertices, faces=faces[1:])
    surface = link_surface(link(shape))
    assert not surface.closed
    assert "triangles: is not closed (3 open edges)" in surface.warnings[0]


def test_inconsistent_mesh_is_a_warning():
    vertices, faces = box(np.ones(3))
    faces[0] = faces[0, ::-1]
    shape = Geometry("triangles", np.eye(4), vertices=vertices, faces=faces)
    surface = link_surface(link(shape))
    assert not surface.closed
    assert "not turned the same way" in surface.warnings[0]


def test_several_shapes_make_one_surface():
    first, second = Geometry("box", np.eye(4), (1, 1, 1)), Geometry("sphere", T, (0.1,))
    surface = link_surface(link(first, second))
    assert surface.closed
    assert surface.faces.max() == len(surface.vertices) - 1
    single = link_surface(link(second))
    np.testing.assert_array_equal(surface.normals[12:], single.normals)


def test_the_other_kind_serves_when_one_is_missing():
    ball, cube = Geometry("sphere", T, (0.1,)), Geometry("box", T, (1, 1, 1))
    assert len(link_surface(link(visual=[cube])).faces) == 12
    assert len(link_surface(link(cube), "visual").faces) == 12
    assert len(link_surface(link(cube, visual=[ball]), "visual").faces) > 12
    assert link_surface(link()) is None
    with pytest.raises(ValueError, match="kind 'inner' is not allowed; allowed: collision, vis"):
        link_surface(link(), "inner")


@pytest.mark.parametrize(
    ("name", "content", "problem"),
    [
        ("m.obj", b"v 0 0 0\n", "cannot be read|holds no triangle"),
        ("m.obj", b"v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "not finite"),
        ("m.obj", b"\xff\xfe\x00garbage", "cannot be read|holds no triangle"),
        (
            "m.stl",
            b"solid x\nfacet normal 0 0\nouter loop\nvertex a b c\n",
            "cannot be read|no tri",
        ),
        ("m.dae", b"<COLLADA><broken>", "cannot be read|pycollada"),
        ("m.ply", b"not a ply", "cannot be read"),
    ],
)
def test_unreadable_meshes(tmp_path, name, content, problem):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(MeshError, match=problem):
        read_mesh(path)
    assert link_surface(link(Geometry("mesh", T, path=str(path)))) is None


def test_one_unreadable_mesh_disables_only_its_link(tmp_path):
    (tmp_path / "bad.obj").write_text("v 0 0 0\n")
    box_of = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    bad = '<collision><geometry><mesh filename="bad.obj"/></geometry></collision>'
    path = tmp_path / "r.urdf"
    path.write_text(
        f"""<robot name="r"><link name="a">{box_of}</link><link name="b">{box_of}{bad}</link>
        <link name="c"/><joint name="j" type="fixed"><parent link="a"/><child link="b"/></joint>
        <joint name="k" type="fixed"><parent link="a"/><child link="c"/></joint></robot>"""
    )
    surfaces = mechanism_surfaces(load_mechanism(path))
    assert list(surfaces.by_link) == ["a"]
    (warning,) = surfaces.lost
    assert warning.startswith("link 'b': mesh '")
    assert warning.endswith("; no contact is located on it")


def stl(vertices, faces) -> bytes:
    """A binary STL of triangles."""
    facets = [struct.pack("<12fH", 0, 0, 0, *vertices[f].ravel(), 0) for f in faces]
    return bytes(80) + struct.pack("<I", len(faces)) + b"".join(facets)


@pytest.mark.parametrize("factor", [1000.0, np.nan, np.inf, 1e38])
def test_a_mesh_of_another_size_or_without_numbers_disables_its_link(tmp_path, factor):
    vertices = TETRAHEDRON.copy()
    vertices[1, 0] *= factor
    (tmp_path / "odd.stl").write_bytes(stl(vertices, TETRAHEDRON_FACES))
    path = tmp_path / "r.urdf"
    box_of = '<collision><geometry><box size=".1 .1 .1"/></geometry></collision>'
    odd = '<collision><geometry><mesh filename="odd.stl"/></geometry></collision>'
    path.write_text(
        f"""<robot name="r"><link name="a">{box_of}</link><link name="b">{odd}</link>
        <joint name="j" type="fixed"><parent link="a"/><child link="b"/>
        <origin xyz="0 0 1"/></joint></robot>"""
    )
    surfaces = mechanism_surfaces(load_mechanism(path))
    (lost,) = surfaces.lost
    assert list(surfaces.by_link) == ["a"]
    assert lost.startswith("link 'b': ") and lost.endswith("; no contact is located on it")


def test_a_robot_whose_surfaces_are_all_tiny_is_told(tmp_path):
    path = tmp_path / "r.urdf"
    shape = '<collision><geometry><box size="1e-4 1e-4 1e-4"/></geometry></collision>'
    path.write_text(
        f"""<robot name="r"><link name="a">{shape}</link><link name="b">{shape}</link>
        <joint name="j" type="fixed"><parent link="a"/><child link="b"/>
        <origin xyz="0 0 1"/></joint></robot>"""
    )
    (lost,) = mechanism_surfaces(load_mechanism(path)).lost
    assert lost.startswith("the largest surface is 0.173 mm long, on a robot of 1 m")


def test_real_arms(example_urdf):
    """Collision shapes have outward normals: rays from outside meet them head on first."""
    pytest.importorskip("collada")
    mechanism = load_urdf(example_urdf)
    assert mechanism.warnings == ()
    surfaces = mechanism_surfaces(mechanism)
    assert len(surfaces.by_link) >= 8 and surfaces.lost == ()
    for surface in surfaces.by_link.values():
        assert np.ptp(surface.vertices, axis=0).max() < 1.0  # metres, not millimetres
        assert volume(surface) > 0
        far = np.argmax(surface.vertices @ [1.0, 0, 0])
        around = (surface.faces == far).any(axis=1) & (surface.areas > 1e-9)
        assert (surface.normals[around] @ [1.0, 0, 0]).max() > 0
