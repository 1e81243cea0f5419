# SPDX-License-Identifier: Apache-2.0
"""`check` of arms whose torques come from motor currents: rotors, uneven friction, held outputs."""

import re
from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.check import loads
from touchline.check.findings import Findings
from touchline.check.injected import Case, _last_link, _loads, _with_mass, make_case
from touchline.check.recording import check_recording
from touchline.identify.evidence import Evidence
from touchline.logs import write_table
from touchline.model.robot import Robot

JOINTS = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
TEXT = """\
model: package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf
noise: {tau: 0.05}
joints:
""" + "".join(f"  - {{name: {name}_joint, torque: motor}}\n" for name in JOINTS)
RUBBING = 15.0, 10.0, 6.0, 2.0, 2.0, 2.0  # Nm of dry friction, as harmonic drives have


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    file = tmp_path_factory.mktemp("motor") / "robot.yaml"
    file.write_text(TEXT)
    return file


@pytest.fixture
def case(path):
    return make_case(tl.load_robot(path), (), np.random.default_rng(5))


def acceleration(case, j):
    return np.gradient(case.samples.qd[:, j], case.samples.time)


def rub(case):
    for j, dry in enumerate(RUBBING):
        case.samples.tau[:, j] += dry * np.tanh(case.samples.qd[:, j] / 0.02)


def told(case, path, tmp_path):
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    findings = Findings()
    check_recording(tl.load_robot(path), tmp_path / "log.parquet", findings)
    return findings.findings


def test_a_motor_arm_without_errors_is_silent(case, path, tmp_path):
    assert told(case, path, tmp_path) == []


def test_a_rotor_is_no_wrong_gain(case, path, tmp_path):
    case.samples.tau[:, 0] += 4.0 * acceleration(case, 0)
    (line,) = told(case, path, tmp_path)
    found = re.search(r"shoulder_pan_joint shows an inertia of (\S+) ", line)
    assert found is not None and float(found[1]) == pytest.approx(4.0, rel=0.1)


def test_a_wrong_gain_is_no_rotor(case, path, tmp_path):
    case.samples.tau[:, 1] *= 1.4
    lines = told(case, path, tmp_path)
    assert any("shoulder_lift_joint is 1.39 times" in line for line in lines), lines
    assert not any("shows an inertia" in line for line in lines)


def test_what_a_motion_does_not_tell_is_said(path, tmp_path):
    robot = tl.load_robot(path)
    case = make_case(robot, (), np.random.default_rng(5))
    # Only the first joint moves: what it accelerates is always the same.
    s = case.samples
    s.q[:, 1:], s.qd[:, 1:] = s.q[0, 1:], 0.0
    true = Robot(robot.description, case.mechanism)
    s.tau[:] = _loads(true, s.time, s.q, s.qd)[0]
    s.tau[:, 0] += 3.0 * acceleration(case, 0)
    s.tau[:] += 0.05 * np.random.default_rng(1).normal(size=s.tau.shape)
    lines = [line for line in told(case, path, tmp_path) if "shoulder_pan" in line]
    assert len(lines) == 1 and "rotor_inertia: this motion tells no more" in lines[0]


def stretched(path, seed=5):
    """Small motion of a stretched arm: its shoulder bears much the same weight all the time."""
    robot = tl.load_robot(path)
    case = make_case(robot, (), np.random.default_rng(seed))
    s = case.samples
    s.q[:], s.qd[:] = 0.3 * s.q, 0.3 * s.qd
    s.tau[:] = _loads(Robot(robot.description, case.mechanism), s.time, s.q, s.qd)[0]
    s.tau[:] += 0.05 * case.rng.normal(size=s.tau.shape)
    return case


def test_a_gain_and_friction_little_off_are_no_wrong_mass(path, tmp_path, monkeypatch):
    case = stretched(path)
    case.samples.tau[:, 1] *= 0.85
    rub(case)
    case.samples.tau[:, 1] += 3.0  # a third stronger one way
    lines = told(case, path, tmp_path)
    assert not any("weighs" in line or "missing at" in line for line in lines), lines
    monkeypatch.setattr(loads, "UNEVEN", 0.0)
    monkeypatch.setattr(loads, "GAIN", 0.0)
    # Nor do links that are off as usual, or an offset of one torque, speak against it then.
    none = property(lambda e: np.zeros((*e.reading.shape, 0)))
    monkeypatch.setattr(Evidence, "usual_links", none)
    monkeypatch.setattr(loads, "_offsets", lambda *_: [])
    assert any("weighs" in line for line in told(case, path, tmp_path))


def test_a_load_is_weighed_beside_friction(path, tmp_path):
    robot = tl.load_robot(path)
    clean = make_case(robot, (), np.random.default_rng(6))
    loaded = Case(robot, np.random.default_rng(6), clean.mechanism, clean.samples)
    _with_mass(loaded, _last_link(loaded), 2.5, np.array([0.0, 0.0, 0.05]))
    s = clean.samples
    true = Robot(robot.description, loaded.mechanism)
    case = replace(loaded, samples=replace(s, tau=_loads(true, s.time, s.q, s.qd)[0]))
    rub(case)
    case.samples.tau[:, 2] += 1.5
    (line,) = [x for x in told(case, path, tmp_path) if "missing at" in x]
    found = re.match(r"(\S+) \+- (\S+) kg", line)
    assert found is not None and abs(float(found[1]) - 2.5) < 2.0 * max(float(found[2]), 0.1)


def test_an_output_may_rest_with_its_joint(case, path, tmp_path):
    s = case.samples
    still = slice(0, 300)
    s.q[still, 1], s.qd[still, 1] = s.q[300, 1], 0.0
    s.tau[still, 1] = s.tau[300, 1]
    assert not any("stuck" in line for line in told(case, path, tmp_path))
    s.q[still, 1] += 1e-4 * np.sin(np.arange(300))
    assert any("shoulder_lift_joint" in x and "stuck" in x for x in told(case, path, tmp_path))


@pytest.mark.parametrize("seed", [5, 6])
def test_friction_turns_no_sign(path, tmp_path, seed):
    case = make_case(tl.load_robot(path), (), np.random.default_rng(seed))
    rub(case)
    lines = told(case, path, tmp_path)
    assert not any("opposite sign" in line or "order" in line for line in lines), lines


def test_a_wrong_sign_is_told_beside_friction(case, path, tmp_path):
    rub(case)
    case.samples.tau[:, 1] *= -1.0
    lines = told(case, path, tmp_path)
    assert any("shoulder_lift_joint" in x and "opposite sign" in x for x in lines), lines


def test_what_friction_holds_tells_nothing(path, tmp_path):
    robot = tl.load_robot(path)
    case = make_case(robot, (), np.random.default_rng(5))
    s = case.samples
    s.q[:, :5], s.qd[:, :5] = s.q[0, :5], 0.0
    s.tau[:] = _loads(Robot(robot.description, case.mechanism), s.time, s.q, s.qd)[0]
    s.tau[:] += 0.05 * case.rng.normal(size=s.tau.shape)
    s.tau[:, :5] += 0.8 * np.array(RUBBING[:5]) * case.rng.choice([-1.0, 1.0], 5)
    assert told(case, path, tmp_path) == []


LIGHT = TEXT.replace("ur10_robot", "ur3_robot")
LIGHT_RUBBING = 4.0, 4.0, 2.0, 0.8, 0.8, 0.8  # Nm


def moved(path, seed, mass, gains, size):
    """A light arm with rotors, and friction that differs by a fifth with its sense."""
    path.write_text(LIGHT)
    robot = tl.load_robot(path)
    clean, rng = make_case(robot, (), np.random.default_rng(seed)), np.random.default_rng([seed, 9])
    loaded = Case(robot, np.random.default_rng(seed), clean.mechanism, clean.samples)
    if mass:
        _with_mass(loaded, _last_link(loaded), mass, np.append(rng.uniform(-0.03, 0.03, 2), 0.05))
    s = clean.samples
    s.q[:], s.qd[:] = s.q[0] + size * (s.q - s.q[0]), size * s.qd
    tau = _loads(Robot(robot.description, loaded.mechanism), s.time, s.q, s.qd)[0] * gains
    for j, dry in enumerate(LIGHT_RUBBING):
        uneven = 1.0 + 0.2 * rng.uniform(-1.0, 1.0) * np.sign(s.qd[:, j])
        tau[:, j] += dry * (uneven * np.tanh(s.qd[:, j] / 0.02) + 0.3 * s.qd[:, j])
        tau[:, j] += 0.1 * dry * np.gradient(s.qd[:, j], s.time)
    tau += 0.05 * rng.normal(size=tau.shape)
    return replace(loaded, samples=replace(s, tau=tau))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_wrong_gains_are_no_heavy_link(tmp_path, seed):
    file = tmp_path / "robot.yaml"
    case = moved(file, seed, 0.0, np.array([1.0, 1.3, 1.6, 1.0, 1.0, 1.0]), 1.0)
    lines = told(case, file, tmp_path)
    assert not any("weighs" in line or "missing at" in line for line in lines), lines
    assert any("elbow_joint is 1." in line for line in lines), lines


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_load_is_no_wrong_gain(tmp_path, seed):
    file = tmp_path / "robot.yaml"
    lines = told(moved(file, seed, 1.0, np.ones(6), 0.3), file, tmp_path)
    assert any("missing at" in line for line in lines), lines
    assert not any("times what" in line for line in lines), lines


def test_a_small_load_is_told_as_load_or_gains(tmp_path):
    """Half a kilogram, in a motion so small that its weight is less sure than is asked for."""
    file = tmp_path / "robot.yaml"
    lines = told(moved(file, 2, 0.5, np.ones(6), 0.3), file, tmp_path)
    gains = [line for line in lines if "times what" in line]
    assert len(gains) == 2, lines
    found = [re.search(r"load or gains\? (\S+) kg more at ee_link", line) for line in gains]
    assert all(x is not None and abs(float(x[1]) - 0.5) < 0.1 for x in found), lines


def test_gains_that_no_load_explains_are_gains(tmp_path):
    file = tmp_path / "robot.yaml"
    case = moved(file, 2, 0.0, np.array([1.0, 1.25, 1.25, 1.0, 1.0, 1.0]), 1.0)
    lines = [line for line in told(case, file, tmp_path) if "times what" in line]
    assert len(lines) == 2 and not any("load or" in line for line in lines), lines


def test_gains_that_explain_as_much_as_a_link_are_told_beside_it(tmp_path):
    file = tmp_path / "robot.yaml"
    case = moved(file, 1, 0.0, np.full(6, 1.4), 1.0)
    (line,) = [line for line in told(case, file, tmp_path) if "weighs" in line]
    assert re.search(r"or as well: gains of 1\.\d+ \(shoulder_lift_joint\), 1\.\d+ \(elbow", line)
