# SPDX-License-Identifier: Apache-2.0
"""The URDF and the descriptions: numbers as stated, inertias as the meshes say."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
import trimesh
import yaml
from arms import files, kinematics
from arms.inertia import uniform_body
from arms.trim import trims
from conftest import poses

mujoco = pytest.importorskip("mujoco")


@pytest.fixture(scope="module")
def inertials(robots):
    """Mass, com (3,), inertia (3, 3) of each link as the URDF has them."""
    result = {}
    for link in ET.parse(robots / "sara" / "sara.urdf").getroot().findall("link"):
        inertial = link.find("inertial")
        if inertial is not None:
            i = {k: float(v) for k, v in inertial.find("inertia").attrib.items()}
            rows = [["ixx", "ixy", "ixz"], ["ixy", "iyy", "iyz"], ["ixz", "iyz", "izz"]]
            matrix = np.array([[i[k] for k in row] for row in rows])
            com = np.array(inertial.find("origin").get("xyz").split(), dtype=float)
            result[link.get("name")] = (float(inertial.find("mass").get("value")), com, matrix)
    return result


def test_masses_and_reach_are_as_stated(inertials):
    assert sum(inertials[name][0] for name in kinematics.MOVING) == pytest.approx(25.0)
    T = poses(np.zeros(7))
    axis_2, flange = T["link2"][:3, 3], T["tool"][:3, 3]
    assert flange - axis_2 == pytest.approx([0, 0, 1.125])


def test_the_tool_ends_at_the_stated_reach(shells):
    T = poses(np.zeros(7))
    tip = trimesh.transform_points(shells["tool"].vertices, T["tool"])[:, 2].max()
    assert tip - T["link2"][2, 3] == pytest.approx(kinematics.REACH, abs=5e-4)


def test_inertia_is_that_of_the_mesh(inertials, shells):
    assert set(inertials) == set(shells)
    for name, (mass, com, inertia) in inertials.items():
        mesh = shells[name].copy()
        mesh.density = mass / mesh.volume
        assert com == pytest.approx(mesh.center_mass, abs=1e-7)
        assert inertia == pytest.approx(mesh.moment_inertia, rel=1e-5, abs=1e-8)
        assert 800 < mesh.density < 4000


def test_inertia_is_physical(inertials):
    for _, _, inertia in inertials.values():
        moments = np.linalg.eigvalsh(inertia)
        assert moments[0] > 0 and moments[0] + moments[1] > moments[2]


def test_mujoco_loads_the_urdf(robots):
    model = mujoco.MjModel.from_xml_path(str(robots / "sara" / "sara.urdf"))
    assert model.njnt == 7
    assert model.body_mass.sum() == pytest.approx(sum(kinematics.MASSES.values()))
    data = mujoco.MjData(model)
    data.qpos[:] = q = np.array([0.3, -0.7, 0.4, 1.1, -0.5, 0.6, 0.2])
    mujoco.mj_kinematics(model, data)
    T = poses(q)
    for name in ("link4", "tool", "handle"):
        assert data.body(name).xpos == pytest.approx(T[name][:3, 3])
        assert data.body(name).xmat == pytest.approx(T[name][:3, :3].ravel())


def test_committed_text_is_what_the_script_writes(robots, shells):
    bodies = {name: uniform_body(shells[name], mass) for name, mass in kinematics.MASSES.items()}
    written = (robots / "sara" / "sara.urdf").read_text()
    assert files.urdf(bodies, set(trims())) == written
    assert files.simulation_yaml() == (robots / "sara" / "simulation.yaml").read_text()
    for name in files.HEADERS:
        assert files.robot_yaml(name) == (robots / name / "robot.yaml").read_text()


def test_trims_are_closed_and_what_the_script_makes(robots):
    for name, made in trims().items():
        read = trimesh.load(robots / "sara" / "meshes" / f"{name}_trim.stl", force="mesh")
        assert read.is_watertight and read.volume > 0
        assert read.triangles == pytest.approx(made.triangles, abs=1e-6)


def test_script_makes_the_committed_shell(shells):
    pytest.importorskip("fast_simplification", reason="only needed to make the meshes anew")
    from make_arms import make_shells

    made = make_shells({"link7"})["link7"]
    assert len(made.faces) == len(shells["link7"].faces)
    assert made.volume == pytest.approx(shells["link7"].volume, rel=1e-4)
    assert made.bounds == pytest.approx(shells["link7"].bounds, abs=1e-4)


@pytest.mark.parametrize("name", sorted(files.HEADERS))
def test_description_names_what_the_model_has(robots, name):
    text = yaml.safe_load((robots / name / "robot.yaml").read_text())
    root = ET.parse(robots / "sara" / "sara.urdf").getroot()
    movable = [j.get("name") for j in root.findall("joint") if j.get("type") == "revolute"]
    assert text["name"] == name and [j["name"] for j in text["joints"]] == movable
    links = {link.get("name") for link in root.findall("link")}
    sensors = {s["name"]: s for s in text["force_torque_sensors"]}
    assert {s["link"] for s in sensors.values()} == {"link0", "tool", "handle"} <= links
    sources = [
        j["torque"].get("from") if isinstance(j["torque"], dict) else None for j in text["joints"]
    ]
    layout = [["base"], None, None, None, None, ["wrist"], ["wrist"]]
    assert sources == ([None] * 7 if name == "sara-full" else layout)
    assert len(sensors["handle"]["axes"]) == (1 if name == "sara-handle-1axis" else 6)


def test_suggested_gains_hold_the_arm(robots):
    gains = yaml.safe_load((robots / "sara" / "simulation.yaml").read_text())
    home, stiffness, damping = (np.array(gains[k]) for k in ("home", "stiffness", "damping"))
    model = mujoco.MjModel.from_xml_path(str(robots / "sara" / "sara.urdf"))
    model.opt.timestep, model.opt.disableflags = 2.5e-4, mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    data.qpos[:] = home + 0.1
    for _ in range(6000):
        mujoco.mj_step1(model, data)
        torque = stiffness * (home - data.qpos) - damping * data.qvel
        data.qfrc_applied[:] = torque + data.qfrc_bias
        mujoco.mj_step2(model, data)
    assert np.abs(data.qpos - home).max() < 2e-3
    assert (np.abs(home) < model.jnt_range[:, 1]).all()
