# SPDX-License-Identifier: Apache-2.0
import struct

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.model.kinematics import link_poses
from touchline.model.loading import load_mechanism
from touchline.model.topology import independent_joints
from touchline.model.urdf import load_urdf

INERTIAL = """<inertial>{origin}<mass value="{mass}"/>
<inertia ixx="{ixx}" iyy="0.02" izz="0.03" ixy="0.001" ixz="0.002" iyz="0.003"/></inertial>"""


def link(name, origin="", mass=1.0, ixx=0.02, more=""):
    inertial = INERTIAL.format(origin=origin, mass=mass, ixx=ixx)
    return f'<link name="{name}">{inertial}{more}</link>'


def joint(name, parent, child, kind="revolute", more='<axis xyz="0 0 1"/>'):
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{more}</joint>'


def write(tmp_path, *elements):
    path = tmp_path / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(elements)}</robot>')
    return path


def problems_of(path):
    with pytest.raises(InputError) as error:
        load_urdf(path)
    return [line.removeprefix(f"{path}: ") for line in error.value.problems]


def random_positions(mechanism, seed):
    names = independent_joints(mechanism)
    return dict(zip(names, np.random.default_rng(seed).uniform(-2, 2, len(names)), strict=True))


@pytest.mark.parametrize("seed", range(3))
def test_poses_are_pinocchio_s(example_urdf, seed):
    pin = pytest.importorskip("pinocchio")
    mechanism = load_urdf(example_urdf)
    model = pin.buildModelFromUrdf(str(example_urdf), False)  # without its mimic joints
    data = model.createData()
    positions = random_positions(mechanism, seed)
    configuration = pin.neutral(model)
    for index in range(1, model.njoints):
        joint = mechanism.joints[model.names[index]]
        master, ratio = (
            (joint.mimic.joint, joint.mimic.multiplier) if joint.mimic else (joint.name, 1)
        )
        q, first = positions[master] * ratio, model.joints[index].idx_q
        turning = model.joints[index].nq == 2
        configuration[first : first + 1 + turning] = (np.cos(q), np.sin(q)) if turning else q
    pin.framesForwardKinematics(model, data, configuration)
    root = data.oMf[model.getFrameId(mechanism.root, pin.FrameType.BODY)]
    for name, T in link_poses(mechanism, positions).items():
        frame = data.oMf[model.getFrameId(name, pin.FrameType.BODY)]
        np.testing.assert_allclose(T, (root.inverse() * frame).homogeneous, atol=1e-12)


def test_masses_are_pinocchio_s(example_urdf):
    """Per joint, what is fixed together has Pinocchio's mass, centre and inertia."""
    pin = pytest.importorskip("pinocchio")
    from touchline.model.topology import outboard_links
    from touchline.model.transforms import combine_inertias, move_inertia

    mechanism = load_urdf(example_urdf)
    model = pin.buildModelFromUrdf(str(example_urdf), False)
    assert model.njoints > 6
    poses = link_poses(mechanism, {})
    for index in range(1, model.njoints):
        child = mechanism.joints[model.names[index]].child
        body = outboard_links(mechanism, child, lambda joint: joint.kind == "fixed")
        to_child = np.linalg.inv(poses[child])
        parts = [move_inertia(mechanism.links[n].inertia, to_child @ poses[n]) for n in body]
        ours, theirs = combine_inertias(parts), model.inertias[index]
        assert ours.mass == pytest.approx(theirs.mass, abs=1e-12)
        if ours.mass > 0:
            np.testing.assert_allclose(ours.com, theirs.lever, atol=1e-12)
            np.testing.assert_allclose(ours.inertia, theirs.inertia, atol=1e-12)
    total = sum(link.inertia.mass for link in mechanism.links.values())
    everything = pin.computeTotalMass(model) + model.inertias[0].mass
    assert total == pytest.approx(everything, abs=1e-12)


def test_limits_are_pinocchio_s(example_urdf):
    pin = pytest.importorskip("pinocchio")
    mechanism = load_urdf(example_urdf)
    model = pin.buildModelFromUrdf(str(example_urdf), False)
    for index in range(1, model.njoints):
        joint, first = mechanism.joints[model.names[index]], model.joints[index].idx_v
        assert joint.effort == model.upperEffortLimit[first]
        assert joint.velocity == model.upperVelocityLimit[first]
        if model.joints[index].nq == 1:
            position = model.joints[index].idx_q
            assert joint.lower == model.lowerPositionLimit[position]
            assert joint.upper == model.upperPositionLimit[position]


def test_gen3_has_no_meshes_but_loads(data_folder):
    mechanism = load_urdf(data_folder / "kinova_gen3" / "kinovaGen3V12.urdf")
    assert independent_joints(mechanism) == [f"joint_{i}" for i in range(1, 8)]
    (warning,) = mechanism.warnings
    assert "package 'kortex_description' not found" in warning
    assert "no contact is located on link 'base_link', 'shoulder_link'" in warning


def test_inertia_is_turned_into_link_axes(tmp_path):
    turned = '<origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>'
    body = load_urdf(write(tmp_path, link("a", turned))).links["a"].inertia
    np.testing.assert_allclose(body.com, [1, 2, 3])
    # x of the inertial frame is y of the link, y is -x.
    expected = [[0.02, -0.001, -0.003], [-0.001, 0.02, 0.002], [-0.003, 0.002, 0.03]]
    np.testing.assert_allclose(body.inertia, expected, atol=1e-15)


def test_axis_default_and_length(tmp_path):
    links = link("a"), link("b"), link("c")
    path = write(
        tmp_path,
        *links,
        joint("j", "a", "b", more=""),
        joint("k", "b", "c", more='<axis xyz="0 3 4"/>'),
    )
    joints = load_urdf(path).joints
    np.testing.assert_allclose(joints["j"].axis, [1, 0, 0])
    np.testing.assert_allclose(joints["k"].axis, [0, 0.6, 0.8])


def test_mimic_of_mimic_is_expanded(tmp_path):
    path = write(
        tmp_path,
        *map(link, "abcd"),
        joint("j", "a", "b"),
        joint("k", "b", "c", more='<mimic joint="j" multiplier="2" offset="0.5"/>'),
        joint("l", "c", "d", more='<mimic joint="k" multiplier="-3" offset="0.1"/>'),
    )
    mechanism = load_urdf(path)
    mimic = mechanism.joints["l"].mimic
    assert (mimic.joint, mimic.multiplier) == ("j", -6)
    assert mimic.offset == pytest.approx(-1.4)
    assert independent_joints(mechanism) == ["j"]


PAIR = (link("a"), link("b"))
MESH = '<collision><geometry><mesh filename="{}"{}/></geometry></collision>'


@pytest.mark.parametrize(
    ("elements", "problem"),
    [
        ((), "no <link> in it"),
        (("<link/>", link("a")), "link number 1: has no name"),
        ((link("a"), link("a")), "link 'a': the name stands twice"),
        ((*PAIR, joint("", "a", "b")), "joint number 1: has no name"),
        (
            (*PAIR, joint("j", "a", "b", "revolut")),
            "joint 'j': type 'revolut' is not allowed; allowed: revolute, prismatic, fixed, "
            "continuous (did you mean 'revolute'?)",
        ),
        (
            (*PAIR, link("c"), joint("i", "a", "b"), joint("j", "b", "c", "floating")),
            "joint 'j': type 'floating' is not supported",
        ),
        ((*PAIR, joint("j", "a", "b", "planar")), "joint 'j': type 'planar' is not supported"),
        ((*PAIR, joint("j", "a", "B")), "joint 'j': child link 'B' does not exist"),
        ((*PAIR, joint("j", "bb", "b")), "joint 'j': parent link 'bb' does not exist (did you m"),
        ((*PAIR, '<joint name="j" type="fixed"><parent link="a"/></joint>'), "joint 'j': has no <"),
        ((*PAIR, joint("j", "a", "b", more='<axis xyz="0 0 0"/>')), "joint 'j': the axis is zero"),
        ((*PAIR, joint("j", "a", "b", more='<axis xyz="0 1"/>')), "joint 'j': <axis xyz='0 1'> is"),
        ((*PAIR, joint("j", "a", "b", more='<axis xyz="0 0 nan"/>')), "joint 'j': <axis xyz='0 0"),
        (
            (*PAIR, joint("j", "a", "b", more='<origin rpy="${pi} 0 0"/>')),
            "joint 'j': <origin rpy='${pi} 0 0'> is not 3 finite numbers (run xacro on the file",
        ),
        (
            (*PAIR, joint("j", "a", "b", more='<limit lower="1" upper="-1"/>')),
            "joint 'j': lower limit 1 is above the upper limit -1",
        ),
        (
            (*PAIR, joint("j", "a", "b", more='<mimic joint="i"/>')),
            "joint 'j': mimics the unknown joint 'i'",
        ),
        (
            (*PAIR, joint("j", "a", "b", more='<mimic joint="j"/>')),
            "joint 'j': mimics itself: j -> j",
        ),
        ((*PAIR, joint("j", "a", "b", more="<mimic/>")), "joint 'j': <mimic> has no 'joint'"),
        (
            (*PAIR, link("c"), joint("j", "a", "b", "fixed"),
             joint("k", "b", "c", more='<mimic joint="j"/>')),
            "joint 'k': mimics 'j', which is fixed",
        ),
        (PAIR, "links: 'a', 'b' are no joint's child: a robot has one root link; join them"),
        (
            (*PAIR, joint("j", "a", "b"), joint("k", "a", "b")),
            "link 'b': is the child of two joints, 'j' and 'k'",
        ),
        (
            (*PAIR, link("c"), joint("j", "b", "c"), joint("k", "c", "b")),
            "joints: b -> c -> b form a loop; a robot must be a tree",
        ),
        ((*PAIR, joint("j", "a", "b"), joint("k", "b", "a")), "joints: "),
        ((link("a", mass=-1),), "link 'a': mass -1 kg is negative"),
        ((link("a", mass="x"),), "link 'a': <mass value='x'> is not a finite number"),
        ((link("a", ixx="inf"),), "link 'a': <inertia ixx='inf'> is not a finite number"),
        (('<link name="a"><inertial/></link>',), "link 'a': <inertial> has no <mass>"),
        (
            ('<link name="a"><inertial><mass value="1"/></inertial></link>',),
            "link 'a': <inertial> has no <inertia>",
        ),
        ((link("a", more="<visual/>"),), "link 'a': <visual> has no shape in a <geometry>"),
        (
            (link("a", more="<visual><geometry><cone/></geometry></visual>"),),
            "link 'a': unknown shape <cone>; allowed: mesh, box, sphere, cylinder, capsule",
        ),
        (
            (link("a", more='<visual><geometry><box size="1 2"/></geometry></visual>'),),
            "link 'a': <box size='1 2'> is not 3 finite numbers",
        ),
        (
            (link("a", more='<visual><geometry><sphere radius="-1"/></geometry></visual>'),),
            "link 'a': <sphere> has a negative size",
        ),
        ((link("a", more="<visual><geometry><mesh/></geometry></visual>"),), "link 'a': <mesh> h"),
    ],
)  # fmt: skip
def test_one_error(tmp_path, elements, problem):
    found = problems_of(write(tmp_path, *elements))
    assert len(found) == 1, found
    assert found[0].startswith(problem)


def test_a_robot_on_a_floating_joint_stands_still_and_is_told(tmp_path):
    parts = (*PAIR, link("c"), joint("i", "a", "b", "floating"), joint("j", "b", "c"))
    mechanism = load_urdf(write(tmp_path, *parts))
    assert {name: j.kind for name, j in mechanism.joints.items()} == {
        "i": "fixed",
        "j": "revolute",
    }
    (warning,) = mechanism.warnings
    assert "b floats on a free joint; it is taken to stand still on the world" in warning


def test_all_errors_at_once(tmp_path):
    path = write(
        tmp_path,
        link("a", mass=-1),
        link("b", ixx="x"),
        link("b"),
        joint("j", "a", "c"),
        joint("k", "a", "b", "ball", more='<axis xyz="0 0 0"/>'),
    )
    found = problems_of(path)
    assert len(found) == 6
    for place in ("link 'a'", "link 'b': <in", "link 'b': the", "joint 'j'", "joint 'k': type"):
        assert sum(line.startswith(place) for line in found) == 1


def test_file_problems(tmp_path):
    path = tmp_path / "robot.urdf"
    for text, problem in (
        ("<robot><link></robot>", r"robot\.urdf:1:\d+: not well-formed XML: mismatched tag"),
        ("", r"robot\.urdf:1:1: not well-formed XML: no element found"),
        ("<sdf/>", r"robot\.urdf: the root element is <sdf>; a URDF has <robot>, an MJCF <mujoco>"),
        (
            '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:arm/></robot>',
            r"name the file \.xacro",
        ),  # ,
    ):
        path.write_text(text)
        with pytest.raises(InputError, match=problem):
            load_mechanism(path)
    with pytest.raises(InputError, match=r"gone\.urdf: no such file"):
        load_mechanism(tmp_path / "gone.urdf")


def test_namespace_of_xacro_alone_is_no_error(tmp_path):
    path = write(tmp_path, link("a"))
    path.write_text(path.read_text().replace("<robot", '<robot xmlns:xacro="http://xacro"', 1))
    assert load_urdf(path).root == "a"


def test_suspicious_masses_are_warnings(tmp_path):
    path = write(
        tmp_path,
        link("a"),
        '<link name="b"/><link name="c"/>',
        link("d", ixx=0.9),
        link("e", ixx=-0.9),
        joint("j", "a", "b"),
        joint("f", "b", "c", "fixed"),
        joint("k", "c", "d"),
        joint("l", "d", "e"),
    )
    found = [line.removeprefix(f"{path}: ") for line in load_urdf(path).warnings]
    assert [line[:22] for line in found] == [
        "link 'd': no body has ",
        "link 'e': the inertia ",
        "link 'b': moves with j",
    ]


def test_a_massless_link_with_a_mass_fixed_to_it_is_fine(tmp_path):
    path = write(
        tmp_path,
        link("a"),
        '<link name="b"/>',
        link("c"),
        joint("j", "a", "b"),
        joint("f", "b", "c", "fixed"),
    )
    assert load_urdf(path).warnings == ()


def binary_stl(triangles):
    facets = b"".join(
        struct.pack("<12fH", 0, 0, 0, *np.asarray(corner, float).ravel(), 0) for corner in triangles
    )
    return b"\0" * 80 + struct.pack("<I", len(triangles)) + facets


@pytest.mark.parametrize(
    ("content", "uri", "problem"),
    [
        (None, "gone.stl", "mesh 'gone.stl': no such file: "),
        (None, "package://no_pkg/gone.stl", "package 'no_pkg' not found: install it, or name"),
        (b"", "m.stl", "mesh 'm.stl': the file is empty"),
        (b"\0" * 20, "m.stl", "mesh 'm.stl': too short for an STL file: 20 bytes"),
        (binary_stl(np.ones((4, 3, 3)))[:-20], "m.stl", "mesh 'm.stl': truncated STL file: 4 fac"),
        (b"x", "m.step", "mesh 'm.step': unknown mesh format '.step'; allowed: .stl, .obj"),
        (b"<html/>", "m.dae", "mesh 'm.dae': no COLLADA document"),
    ],
)
def test_an_unusable_mesh_is_a_warning(tmp_path, content, uri, problem):
    if content is not None:
        (tmp_path / uri).write_bytes(content)
    path = write(tmp_path, link("a", more=MESH.format(uri, "")))
    (warning,) = load_urdf(path).warnings
    assert warning.startswith(f"{path}: {problem}")
    assert warning.endswith("; no contact is located on link 'a'")


def test_a_missing_visual_mesh_beside_a_collision_shape_is_no_matter(tmp_path):
    box = '<collision><geometry><box size="1 1 1"/></geometry></collision>'
    visual = '<visual><geometry><mesh filename="gone.stl"/></geometry></visual>'
    assert load_urdf(write(tmp_path, link("a", more=box + visual))).warnings == ()


def test_shapes_and_their_places(tmp_path):
    more = """<collision><origin xyz="1 2 3" rpy="0 0 1.5707963267948966"/>
      <geometry><cylinder radius="0.1" length="0.5"/></geometry></collision>
      <visual><geometry><mesh filename="m.obj" scale="1 2 -3"/></geometry></visual>"""
    (tmp_path / "m.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    body = load_urdf(write(tmp_path, link("a", more=more))).links["a"]
    (cylinder,), (mesh,) = body.collision, body.visual
    assert (cylinder.kind, cylinder.size) == ("cylinder", (0.1, 0.5))
    np.testing.assert_allclose(cylinder.T_link_shape @ [1, 0, 0, 1], [1, 3, 3, 1])
    assert (mesh.kind, mesh.scale, mesh.path) == ("mesh", (1, 2, -3), str(tmp_path / "m.obj"))


@pytest.mark.parametrize(
    ("many", "told"), [("/gone", "/gone"), ("gone", "{here}/gone"), ("file:///gone", "/gone")]
)
def test_meshes_that_a_folder_lacks_are_told_together(tmp_path, many, told):
    bodies = "".join(
        f'<link name="l{i}"><inertial><mass value="1"/><inertia ixx=".1" iyy=".1" izz=".1" ixy="0" '
        f'ixz="0" iyz="0"/></inertial><collision><geometry><mesh filename="{folder}/m{i}.stl"/>'
        "</geometry></collision></link>"
        for i, folder in enumerate((many, many, many, "/alone"))
    )
    joints = "".join(
        f'<joint name="j{i}" type="revolute"><parent link="l{i}"/><child link="l{i + 1}"/>'
        '<axis xyz="0 1 0"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint>'
        for i in range(3)
    )
    path = tmp_path / "arm.urdf"
    path.write_text(f'<robot name="arm">{bodies}{joints}</robot>')
    found = [line for line in load_mechanism(path).warnings if "no such file" in line]
    folder = told.format(here=tmp_path)
    assert found == [
        f"{path}: meshes in '{folder}': no such files; "
        "no contact is located on link 'l0', 'l1', 'l2'",
        f"{path}: mesh '/alone/m3.stl': no such file; no contact is located on link 'l3'",
    ]
