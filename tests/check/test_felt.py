"""What can be felt, as `check` tells it, beside what the detector finds."""

import numpy as np
import pytest
from robots import load_example

import touchline as tl
from touchline.check.felt import Felt, felt
from touchline.check.run import check
from touchline.detector.detector import Detector
from touchline.localizer.skin import Skin
from touchline.observer.dynamics import contact_loads, gravity_loads
from touchline.observer.observer import Observer

RATE, BEFORE, AFTER = 1000.0, 300, 200  # Hz, samples


def found(robot, patch, force, rng, pushes=60):
    """Share of steps of this size, at random places and postures at rest, that are detected."""
    noise, hits = robot.description.noise, 0
    for _ in range(pushes):
        q = rng.uniform(*robot.ranges)
        poses = robot.poses(q)
        face = rng.choice(
            len(patch.surface.faces), p=patch.surface.areas / patch.surface.areas.sum()
        )
        T = poses[patch.node] @ patch.T_node_link
        point = (
            T[:3, :3] @ patch.surface.vertices[patch.surface.faces[face]].mean(axis=0) + T[:3, 3]
        )
        push = -force * T[:3, :3] @ patch.surface.normals[face]
        loads = contact_loads(robot, q, patch.link, np.r_[push, np.cross(point, push)])
        held = gravity_loads(robot, q)
        on = (np.arange(BEFORE + AFTER) >= BEFORE)[:, None]
        n, k = len(q), len(robot.sensor_names)
        tau = held.torque - on * loads.torque + rng.normal(size=(len(on), n)) * noise.tau
        scatter = np.array([noise.sensors[name] for name in robot.sensor_names]).reshape(k, 6)
        wrench = (
            held.wrench - on[:, None] * loads.wrench + rng.normal(size=(len(on), k, 6)) * scatter
        )
        qd = rng.normal(size=(len(on), n)) * noise.qd
        time = np.arange(len(on)) / RATE
        _, detection = Detector(Observer(robot)).run(
            time, np.tile(q, (len(on), 1)), qd, tau, wrench
        )
        assert not detection.levels[:BEFORE].any()
        hits += bool(detection.levels[BEFORE:].any())
    return hits / pushes


@pytest.mark.parametrize(("name", "link"), [("sara", "link3"), ("panda_hand", "panda_link5")])
def test_forces_are_those_that_the_detector_finds(name, link):
    robot = tl.load_robot(name) if name == "sara" else load_example(name)
    patch = next(p for p in Skin(robot).patches if p.link == link)
    told = next(f for f in felt(robot) if f.link == link)
    rng = np.random.default_rng(1)
    assert found(robot, patch, told.force, rng) >= 0.93
    assert found(robot, patch, told.median, rng) >= 0.25
    assert found(robot, patch, 0.4 * told.median, rng) <= 0.3


def test_the_more_joints_lie_inboard_the_more_is_known():
    robot = load_example("panda_hand")
    ranks = {f.link: f for f in felt(robot)}
    assert ranks["panda_link0"] == Felt("panda_link0", None, np.inf, np.inf, 0)
    assert [ranks[f"panda_link{i}"].rank for i in range(1, 6)] == [1, 2, 3, 4, 5]
    assert ranks["panda_link4"].place == "candidates: 4 of 5 unknowns are measured"
    assert ranks["panda_link7"].place == "a place"


def test_check_tells_what_was_assumed_and_that_nothing_is_measured():
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    result = check("so100")
    assert any("nothing is measured" in line for line in result.findings)
    assert "assumed, as there is no robot.yaml" in result.text()
    text = check("go1").text()
    assert "are those of legs" in text


def test_an_arm_without_surfaces_is_told_so(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(
        '<robot name="arm"><link name="base"/><link name="l"><inertial><mass value="1"/><inertia '
        'ixx=".1" iyy=".1" izz=".1" ixy="0" ixz="0" iyz="0"/></inertial></link><joint name="j" '
        'type="revolute"><parent link="base"/><child link="l"/><axis xyz="0 1 0"/><limit '
        'lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
    )
    (lines,) = [part for name, part in check(path).notes.items() if name == "what can be felt"]
    assert lines == [
        "  no link has a surface: a touch is felt in the joints that it loads, and not located"
    ]
