# SPDX-License-Identifier: Apache-2.0
"""What recordings of unknown arms showed `check` to miss, or to tell wrongly."""

import re
from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.check.findings import Findings
from touchline.check.injected import _loads, make_case
from touchline.check.recording import check_recording, glance
from touchline.logs import write_table
from touchline.model.robot import Robot

MODEL = "package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf"
JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
RUBBING = 15.0, 10.0, 6.0, 2.0, 2.0, 2.0  # Nm of dry friction, as harmonic drives have


@pytest.fixture(params=["motor", "sensor"])
def robot(request, tmp_path):
    lines = [f"  - {{name: {name}_joint, torque: {request.param}}}\n" for name in JOINTS]
    file = tmp_path / "robot.yaml"
    file.write_text(f"model: {MODEL}\nnoise: {{tau: 0.05}}\njoints:\n{''.join(lines)}")
    return tl.load_robot(file)


def told(case, tmp_path):
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    findings = Findings()
    check_recording(case.robot, tmp_path / "log.parquet", findings)
    return findings


def rub(case):
    for j, dry in enumerate(RUBBING):
        case.samples.tau[:, j] += dry * np.tanh(case.samples.qd[:, j] / 0.02)


def test_friction_tells_the_sign_of_light_joints(robot, tmp_path):
    case = make_case(robot, (), np.random.default_rng(5))
    rub(case)
    case.samples.tau[:] *= -1.0
    found = told(case, tmp_path)
    for name in robot.joint_names:
        assert any(f"({name}: sign)" in line for line in found.findings), name
        assert found.fixes["joints"][name]["sign"] == -1.0
    assert not any("gravity" in line or "missing" in line for line in found.findings)


def test_friction_that_is_taken_off_twice_turns_no_sign(robot, tmp_path):
    case = make_case(robot, (), np.random.default_rng(5))
    for j, dry in enumerate(RUBBING):
        case.samples.tau[:, j] -= 0.1 * dry * np.tanh(case.samples.qd[:, j] / 0.02)
    assert not any("sign" in line for line in told(case, tmp_path).findings)


@pytest.mark.parametrize("degrees", [45.0, 90.0, 135.0])
def test_an_arm_on_a_wall_is_told_as_such(robot, tmp_path, degrees):
    case = make_case(robot, (), np.random.default_rng(2))
    way, angle = case.rng.uniform(-np.pi, np.pi), np.radians(degrees)
    side = np.array([np.cos(way), np.sin(way), 0.0])
    gravity = 9.81 * (np.sin(angle) * side - np.cos(angle) * np.array([0.0, 0.0, 1.0]))
    case.mechanism = replace(case.mechanism, gravity=gravity)
    s = case.samples
    s.tau[:] = _loads(Robot(robot.description, case.mechanism), s.time, s.q, s.qd)[0]
    s.tau[:] += 0.05 * case.rng.normal(size=s.tau.shape)
    if robot.description.joints[0].torque == "motor":
        if degrees > 90.0:
            pytest.skip("under a ceiling friction hides it: told as another order of the torques")
        rub(case)
    found = told(case, tmp_path)
    said = re.search(r"the base is tilted by (\S+) ", found.findings[0])
    assert said is not None and abs(float(said[1]) - degrees) < 2.0, found.findings
    wrong = "opposite sign", "order", "taken out"
    assert not any(word in line for line in found.findings for word in wrong)
    np.testing.assert_allclose(found.fixes["gravity"], gravity, atol=0.3)


def test_a_joint_that_turns_on_and_on_is_not_in_degrees(robot, tmp_path):
    case = make_case(robot, (), np.random.default_rng(5))
    s = case.samples
    speed = 0.3
    s.q[:, 5] += speed * (s.time - s.time[0]) + 14.0
    s.qd[:, 5] += speed
    s.tau[:] = _loads(Robot(robot.description, case.mechanism), s.time, s.q, s.qd)[0]
    s.tau[:] += 0.05 * case.rng.normal(size=s.tau.shape)
    (line,) = told(case, tmp_path).findings
    assert "wrist_3_joint goes from" in line and "degrees" not in line


def test_a_glance_tells_of_dead_torques(robot, tmp_path):
    case = make_case(robot, (), np.random.default_rng(5))
    case.samples.tau[:, [1, 2]] = 0.0
    nothing = np.zeros(len(case.samples.time), bool)
    lines = glance(robot, [case.samples], [nothing], False)
    words = "torque of shoulder_lift_joint, elbow_joint are always 0: dead"
    assert any(line.startswith(words) for line in lines), lines
    case.samples.q[:], case.samples.qd[:] = case.samples.q[0], 0.0
    assert not any("always" in x for x in glance(robot, [case.samples], [nothing], False))


@pytest.mark.parametrize("seed", [5, 6, 7])
@pytest.mark.parametrize("robot", ["motor"], indirect=True)
def test_currents_in_amperes_are_told_with_their_gains(robot, tmp_path, seed):
    case = make_case(robot, (), np.random.default_rng(seed))
    rub(case)
    gains = np.array([15.0, 12.0, 9.0, 9.0, 9.0, 9.0])
    case.samples.tau[:] /= gains
    found = told(case, tmp_path)
    assert "motors' currents in amperes" in found.findings[0]
    assert not any(word in x for x in found.findings for word in ("gravity", "order", "sign;"))
    for name, gain in zip(robot.joint_names[1:3], gains[1:3], strict=True):
        assert found.fixes["joints"][name]["gain"] == pytest.approx(gain, rel=0.1)
