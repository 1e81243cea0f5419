# SPDX-License-Identifier: Apache-2.0
import mujoco
import numpy as np
import pytest

from touchline.errors import InputError
from touchline.model.kinematics import joint_position, link_poses
from touchline.model.loading import load_mechanism, read_robot_file
from touchline.model.topology import independent_joints
from touchline.model.transforms import move_inertia

NASTY = """
<mujoco model="nasty">
  <compiler angle="radian"/>
  <option gravity="0.3 0 -9.7"/>
  <asset><mesh name="tet" vertex="0 0 0 .1 0 0 0 .2 0 0 0 .3"/></asset>
  <worldbody>
    <geom type="plane" size="1 1 1"/>
    <geom type="box" size=".1 .2 .3" pos="1 0 0"/>
    <body name="base" pos=".1 .2 .3" euler=".1 .2 .3">
      <geom type="sphere" size=".1" mass="2"/>
      <body name="upper" pos="0 .1 .4" quat="1 .2 .3 .4">
        <joint name="offset" axis="1 2 3" pos=".05 -.02 .1" ref=".4" range="-2 2" limited="true"/>
        <inertial mass="3" pos=".01 .02 .03" fullinertia=".03 .04 .05 .001 .002 .003"/>
        <geom type="mesh" mesh="tet" pos=".1 .2 .3" euler=".3 .2 .1"/>
        <geom type="capsule" size=".03 .2" contype="0" conaffinity="0"/>
        <body name="fore" pos=".2 0 .3" euler="0 1 .2">
          <joint name="first" axis="0 1 0" pos=".1 0 0" ref="-.3"/>
          <joint name="second" type="slide" axis="1 0 1" ref=".05" pos=".3 .2 .1"/>
          <joint name="third" axis="0 0 1" pos="0 .1 .2"/>
          <geom type="capsule" size=".03 .2" mass="1.5" pos=".1 0 .1" euler="1 0 0"/>
          <body name="finger" pos="0 0 .2">
            <joint name="left" type="slide" axis="0 1 0" ref=".01"/>
            <geom type="box" size=".01 .02 .03" mass=".1"/>
          </body>
          <body name="finger2" pos="0 0 .2">
            <joint name="right" type="slide" axis="0 -1 0" ref=".02"/>
            <geom type="ellipsoid" size=".01 .02 .03" mass=".1"/>
          </body>
        </body>
        <body name="handle" pos="-.1 0 0">
          <joint name="crank" axis="0 1 1" actuatorfrclimited="true" actuatorfrcrange="-5 5"/>
          <geom type="cylinder" size=".01 .1" mass=".4" pos="0 0 .1"/>
          <body pos="0 0 .3"><joint axis="1 0 0"/><geom size=".02" mass=".05"/></body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint joint1="right" joint2="left" polycoef=".003 1.5 0 0 0"/></equality>
</mujoco>
"""


@pytest.fixture
def nasty(tmp_path):
    """The nasty robot as our mechanism and as MuJoCo's model."""
    path = tmp_path / "nasty.xml"
    path.write_text(NASTY)
    return load_mechanism(path), mujoco.MjModel.from_xml_path(str(path))


def pose_in(mechanism, model, seed):
    """Return our positions, and MuJoCo's data at the same state."""
    names = independent_joints(mechanism)
    positions = dict(
        zip(names, np.random.default_rng(seed).uniform(-2, 2, len(names)), strict=True)
    )
    data = mujoco.MjData(model)
    for index in range(model.njnt):
        name = model.joint(index).name or f"joint_{index}"
        data.qpos[model.jnt_qposadr[index]] = joint_position(mechanism.joints[name], positions)
    mujoco.mj_kinematics(model, data)
    mujoco.mj_comPos(model, data)
    return positions, data


@pytest.mark.parametrize("seed", range(5))
def test_bodies_are_where_mujoco_has_them(nasty, seed):
    mechanism, model = nasty
    positions, data = pose_in(mechanism, model, seed)
    poses = link_poses(mechanism, positions)
    for index in range(model.nbody):
        T = poses[model.body(index).name or f"body_{index}"]
        np.testing.assert_allclose(T[:3, 3], data.xpos[index], atol=1e-12)
        np.testing.assert_allclose(T[:3, :3], data.xmat[index].reshape(3, 3), atol=1e-12)


def test_axes_are_where_mujoco_has_them(nasty):
    """Each joint's child frame has its origin on the axis."""
    mechanism, model = nasty
    positions, data = pose_in(mechanism, model, 7)
    poses = link_poses(mechanism, positions)
    for index in range(model.njnt):
        joint = mechanism.joints[model.joint(index).name or f"joint_{index}"]
        T = poses[joint.child]
        np.testing.assert_allclose(T[:3, :3] @ joint.axis, data.xaxis[index], atol=1e-12)
        if joint.kind == "revolute":
            np.testing.assert_allclose(T[:3, 3], data.xanchor[index], atol=1e-12)


def test_masses_are_mujoco_s(nasty):
    mechanism, model = nasty
    positions, data = pose_in(mechanism, model, 3)
    poses = link_poses(mechanism, positions)
    for index in range(1, model.nbody):
        name = model.body(index).name or f"body_{index}"
        body = move_inertia(mechanism.links[name].inertia, poses[name])
        axes = data.ximat[index].reshape(3, 3)
        inertia = axes @ np.diag(model.body_inertia[index]) @ axes.T
        assert body.mass == model.body_mass[index]
        np.testing.assert_allclose(body.com, data.xipos[index], atol=1e-12)
        np.testing.assert_allclose(body.inertia, inertia, atol=1e-12)
    bodies = [move_inertia(link.inertia, poses[n]) for n, link in mechanism.links.items()]
    total = sum(body.mass for body in bodies)
    assert total == pytest.approx(model.body_subtreemass[0])
    com = sum(body.mass * body.com for body in bodies) / total
    np.testing.assert_allclose(com, data.subtree_com[0], atol=1e-12)


def test_what_else_is_read(nasty):
    mechanism, model = nasty
    np.testing.assert_array_equal(mechanism.gravity, model.opt.gravity)
    assert (mechanism.name, mechanism.root) == ("nasty", "world")
    assert mechanism.joints["base/fixed"].kind == "fixed"
    right = mechanism.joints["right"].mimic
    # y - 0.02 = 0.003 + 1.5 (x - 0.01)
    assert (right.joint, right.multiplier, right.offset) == ("left", 1.5, pytest.approx(0.008))
    assert (mechanism.joints["offset"].lower, mechanism.joints["offset"].upper) == (-2, 2)
    assert mechanism.joints["crank"].effort == 5
    assert np.isinf(mechanism.joints["crank"].lower)
    assert mechanism.warnings == ()
    assert mechanism.links["fore/first"].virtual


def test_shapes(nasty):
    mechanism, model = nasty
    (box,) = mechanism.links["world"].collision  # the plane is left out
    assert (box.kind, box.size) == ("box", (0.2, 0.4, 0.6))
    (mesh,), (capsule,) = mechanism.links["upper"].collision, mechanism.links["upper"].visual
    assert (capsule.kind, capsule.size) == ("capsule", (0.03, 0.4))
    assert (mesh.kind, len(mesh.faces)) == ("triangles", 4)
    # The file's vertices at the file's pose, although MuJoCo recentres its meshes.
    corners = np.array([[0, 0, 0], [0.1, 0, 0], [0, 0.2, 0], [0, 0, 0.3]])
    quat, R = np.zeros(4), np.zeros(9)
    mujoco.mju_euler2Quat(quat, np.array([0.3, 0.2, 0.1]), "xyz")
    mujoco.mju_quat2Mat(R, quat)
    expected = corners @ R.reshape(3, 3).T + [0.1, 0.2, 0.3]
    distance = np.linalg.norm(expected[:, None] - mesh.vertices[None], axis=2)
    assert distance.min(axis=1).max() < 1e-7


RADIAN = '<compiler angle="radian"/>'


def write(tmp_path, body, more=""):
    path = tmp_path / "robot.xml"
    path.write_text(f"<mujoco>{RADIAN}<worldbody>{body}</worldbody>{more}</mujoco>")
    return path


BALL = '<body name="b"><joint type="ball" name="j"/><geom size=".1"/></body>'
FREE = '<body name="c"><freejoint/><geom size=".1"/></body>'


def test_free_and_ball_joints_are_refused_together(tmp_path):
    with pytest.raises(InputError) as error:
        load_mechanism(write(tmp_path, BALL + FREE))
    ball, free = error.value.problems
    assert "robot.xml: body 'b': ball joint 'j': replace it by three hinge joints" in ball
    assert "robot.xml: body 'c': free joint 'joint_1': the robot must stand on the world" in free


LEG = """<body name="pelvis" pos="0 0 1"><freejoint/><geom size=".1"/>
<body name="thigh"><joint name="hip"/><geom size=".1"/></body></body>"""


def test_a_robot_on_one_free_joint_stands_still_and_is_told(tmp_path):
    mechanism = load_mechanism(write(tmp_path, LEG))
    moving = [name for name, joint in mechanism.joints.items() if joint.kind != "fixed"]
    assert moving == ["hip"]
    assert mechanism.joints["pelvis/fixed"].T_parent_joint[2, 3] == 1.0
    (warning,) = mechanism.warnings
    assert "pelvis floats on a free joint; it is taken to stand still" in warning
    with pytest.raises(InputError, match="body 'c': free joint"):  # an object beside it
        load_mechanism(write(tmp_path, LEG + FREE))


def test_mujoco_s_errors_are_ours(tmp_path):
    with pytest.raises(InputError, match=r"robot\.xml: MuJoCo cannot read it: .*unrecognized"):
        load_mechanism(write(tmp_path, "<boddy/>"))


def test_gravity_switched_off(tmp_path):
    path = write(tmp_path, "", '<option><flag gravity="disable"/></option>')
    np.testing.assert_array_equal(load_mechanism(path).gravity, [0, 0, 0])


TWO = """<body name="b"><joint name="j" ref="0.2"/><geom size=".1"/>
<body name="c" pos="1 0 0"><joint name="k" ref="0.1"/><geom size=".1"/></body></body>"""


@pytest.mark.parametrize(
    ("equality", "note"),
    [
        ('<connect body1="b" body2="c" anchor="0 0 0"/>', "equality 'number 1' (connect) is ign"),
        ('<joint name="e" joint1="k" joint2="j" polycoef="0 1 2 0 0"/>', "equality 'e': 'k' foll"),
    ],
)
def test_equalities_that_are_left_out(tmp_path, equality, note):
    mechanism = load_mechanism(write(tmp_path, TWO, f"<equality>{equality}</equality>"))
    (warning,) = mechanism.warnings
    assert note in warning
    assert independent_joints(mechanism) == ["j", "k"]


def test_inactive_equality(tmp_path):
    equality = '<equality><joint joint1="k" joint2="j" active="false"/></equality>'
    mechanism = load_mechanism(write(tmp_path, TWO, equality))
    assert (mechanism.warnings, independent_joints(mechanism)) == ((), ["j", "k"])


def test_a_joint_held_by_an_equality_is_fixed(tmp_path):
    path = write(tmp_path, TWO, '<equality><joint joint1="k" polycoef="0.5 1 0 0 0"/></equality>')
    mechanism, model = load_mechanism(path), mujoco.MjModel.from_xml_path(str(path))
    assert independent_joints(mechanism) == ["j"]
    data = mujoco.MjData(model)
    data.qpos[:] = [0.7, 0.6]  # k at its reference 0.1 plus 0.5
    mujoco.mj_kinematics(model, data)
    T = link_poses(mechanism, {"j": 0.7})["c"]
    np.testing.assert_allclose(T[:3, :3], data.xmat[2].reshape(3, 3), atol=1e-12)


MESH = '<asset><mesh name="m" file="gone.stl"/></asset>'
INERTIAL = '<inertial mass="1" pos="0 0 0" diaginertia="1 1 1"/>'


def test_a_missing_mesh_is_a_warning(tmp_path):
    body = f'<body name="b">{INERTIAL}<geom type="mesh" mesh="m"/><geom size=".1"/></body>'
    mechanism = load_mechanism(write(tmp_path, body, MESH))
    (warning,) = mechanism.warnings
    assert "mesh 'gone.stl': no such file" in warning
    assert warning.endswith("no contact is located on link 'b'")
    assert mechanism.links["b"].inertia.mass == 1


def test_missing_meshes_of_a_folder_are_told_together(tmp_path):
    assets = "".join(f'<mesh name="m{i}" file="gone/{i}.stl"/>' for i in range(2))
    bodies = "".join(
        f'<body name="b{i}">{INERTIAL}<geom type="mesh" mesh="m{i}"/></body>' for i in range(2)
    )
    mechanism = load_mechanism(write(tmp_path, bodies, f"<asset>{assets}</asset>"))
    (warning,) = [line for line in mechanism.warnings if "no such file" in line]
    assert "/gone': no such files; no contact is located on link 'b0', 'b1'" in warning


def test_a_mass_from_a_missing_mesh_is_an_error(tmp_path):
    body = '<body name="b"><geom type="mesh" mesh="m"/></body>'
    with pytest.raises(InputError, match="body 'b': its mass comes from a mesh that cannot be"):
        load_mechanism(write(tmp_path, body, MESH))


def test_a_missing_mesh_that_no_geom_uses_is_no_matter(tmp_path):
    body = f'<body name="b">{INERTIAL}<geom size=".1"/></body>'
    assert load_mechanism(write(tmp_path, body, MESH)).warnings == ()


def test_other_meshes_are_kept_where_one_is_missing(tmp_path, monkeypatch):
    """The path is relative, as on a command line."""
    folder = tmp_path / "arm"
    (folder / "meshes").mkdir(parents=True)
    corners = "v 0 0 0\nv .1 0 0\nv 0 .2 0\nv 0 0 .3\n"
    (folder / "meshes" / "tet.obj").write_text(corners + "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    body = f"""<body name="b">{INERTIAL}<geom type="mesh" mesh="m"/></body>
        <body name="c" pos="1 0 0"><geom type="mesh" mesh="tet"/></body>"""
    assets = '<compiler meshdir="meshes"/>' + MESH.replace("/>", '/><mesh file="tet.obj"/>', 1)
    write(folder, body, assets)
    monkeypatch.chdir(tmp_path)
    mechanism = load_mechanism("arm/robot.xml")
    (warning,) = mechanism.warnings
    assert "gone.stl" in warning and "arm/arm" not in warning
    assert len(mechanism.links["c"].collision) == 1
    (folder / "meshes" / "tet.obj").unlink()
    with pytest.raises(InputError) as error:
        load_mechanism("arm/robot.xml")
    assert str(error.value).count("robot.xml") == 1


def test_a_truncated_mesh_is_a_warning(tmp_path):
    (tmp_path / "gone.stl").write_bytes(b"\0" * 80 + b"\5\0\0\0")
    body = f'<body name="b">{INERTIAL}<geom type="mesh" mesh="m"/></body>'
    (warning,) = load_mechanism(write(tmp_path, body, MESH)).warnings
    assert "truncated STL file: 5 facets" in warning


def test_two_arms_stand_on_one_world(tmp_path):
    path = write(tmp_path, TWO + TWO.replace('name="', 'name="2'))
    mechanism = load_mechanism(path)
    assert [joint.parent for joint in mechanism.joints.values()].count("world") == 2


def test_an_mjcf_in_a_robot_file(tmp_path, nasty):
    (tmp_path / "robot.yaml").write_text(
        "name: n\nmodel: nasty.xml\nlocked: {left: 0, crank: 0.1}\n"
        "force_torque_sensors: [{name: ft, link: fore, frame: world}]\n"
    )
    robot, mechanism = read_robot_file(tmp_path / "robot.yaml")
    names = [joint.name for joint in robot.joints]
    assert names == ["offset", "first", "second", "third", "joint_7"]
