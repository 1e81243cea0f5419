# SPDX-License-Identifier: Apache-2.0
"""A tool that is rigidly mounted on one force-torque sensor: a robot without joints."""

import json

import numpy as np
import pytest

import touchline as tl
from touchline.cli.main import main
from touchline.trials.touches import TouchSampler, resting_signals

URDF = """<robot name="probe">
  <link name="flange"/>
  <joint name="mount" type="fixed">
    <parent link="flange"/><child link="tool"/><origin xyz="0 0 0.05" rpy="0.3 0 0"/>
  </joint>
  <link name="tool">
    <inertial>
      <origin xyz="0 0 0.1"/><mass value="1.0"/>
      <inertia ixx="0.004" iyy="0.004" izz="0.001" ixy="0" ixz="0" iyz="0"/>
    </inertial>
    <collision>
      <origin xyz="0 0 0.1"/><geometry><cylinder radius="0.03" length="0.2"/></geometry>
    </collision>
  </link>
</robot>"""
ROBOT = """
name: probe
model: probe.urdf
force_torque_sensors: [{name: mount, link: tool}]
noise: {mount: [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}
"""
AXES = ("fx", "fy", "fz", "mx", "my", "mz")


@pytest.fixture
def probe(tmp_path):
    (tmp_path / "probe.urdf").write_text(URDF)
    (tmp_path / "robot.yaml").write_text(ROBOT)
    return tmp_path / "robot.yaml"


def touched(robot, skin, begin=0.6, end=1.0):
    touch = TouchSampler(skin, np.random.default_rng(0), floor=-1.0).sample(20.0)
    noise = np.random.default_rng(1)
    return touch, resting_signals(robot, touch.q, [(touch, begin)], end, noise)


def write_log(path, signals):
    head = ",".join(["time", *(f"mount.{axis}" for axis in AXES)])
    rows = np.column_stack([signals.time, signals.wrench[:, 0]])
    np.savetxt(path, rows, delimiter=",", header=head, comments="")


def test_a_tool_without_joints_is_felt(probe):
    robot = tl.load_robot(probe)
    assert robot.joint_names == () and robot.segment_names == ("mount",)
    live, recorded = tl.Pipeline(robot), tl.Pipeline(robot)
    touch, s = touched(robot, live.skin)
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        result = live.update(*sample)
    (contact,) = result.contacts
    assert contact.status == "located" and contact.link == "tool"
    assert np.linalg.norm(contact.position - touch.position) < 1e-3
    assert np.linalg.norm(contact.force - touch.force) < 0.1
    recorded.run(s.time, s.q, s.qd, s.tau, s.wrench)
    for event in (*live.events, *recorded.events):
        assert 0.6 <= event.detected < 0.62 and event.joint is None
        assert np.linalg.norm(event.position - touch.position) < 1e-3


def test_every_command_takes_it(probe, tmp_path, capsys):
    robot = tl.load_robot(probe)
    touch, s = touched(robot, tl.Pipeline(robot).skin, 2.0, 4.0)
    write_log(tmp_path / "log.csv", s)
    quiet = resting_signals(robot, s.q[0], [], 30.0, np.random.default_rng(2))
    write_log(tmp_path / "quiet.csv", quiet)
    calibrated, out = tmp_path / "calibrated.yaml", tmp_path / "out"
    assert main(["check", str(probe), str(tmp_path / "quiet.csv")]) == 0
    command = ["calibrate", str(tmp_path / "quiet.csv"), "--robot", str(probe)]
    assert main([*command, "--out", str(calibrated)]) == 0
    command = ["analyze", str(tmp_path / "log.csv"), "--robot", str(calibrated)]
    assert main([*command, "--out", str(out)]) == 0
    assert "external wrench" in capsys.readouterr().out
    (event,) = json.loads((out / "events.json").read_text())
    assert np.linalg.norm(np.array(event["position"]) - touch.position) < 1e-3


@pytest.mark.parametrize("scenario", ["free_motion", "three_touches", "random_pushes", "demo"])
def test_a_simulation_needs_joints(probe, tmp_path, capsys, scenario):
    command = ["simulate", scenario, "--robot", str(probe), "--out", str(tmp_path / "x.csv")]
    assert main(command) == 2
    assert "has no joint" in capsys.readouterr().err
