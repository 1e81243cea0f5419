# SPDX-License-Identifier: Apache-2.0
"""`check` and `--fix` on arms that its rules were not made with."""

import numpy as np
import pytest

import touchline as tl
from touchline.check.findings import Findings
from touchline.check.fit import robust_line
from touchline.check.injected import make_case
from touchline.check.recording import check_recording
from touchline.check.run import check, write_fixes
from touchline.cli.main import main
from touchline.logs import write_table
from touchline.model.sources import find_robot

SHARE = "package://example-robot-data/robots"
PANDA = f"""\
model: {SHARE}/panda_description/urdf/panda.urdf
locked: {{panda_finger_joint1: 0.0}}
"""
BASE = """\
force_torque_sensors:
  - {name: base, link: panda_link0, pose: {xyz: [0, 0, 0], rpy: [0, 0, 0]},
     axes: [fx, fy, fz, mx, my, mz], polarity: outboard}
noise: {tau: 0.05, base: [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}
"""
TALOS = f"""\
model: {SHARE}/talos_data/robots/talos_left_arm.urdf
locked: {{gripper_left_joint: 0.0}}
noise: {{tau: 0.05}}
"""
UR5 = f"model: {SHARE}/ur_description/urdf/ur5_robot.urdf\nnoise: {{tau: 0.05}}\n"
XARM7 = f"model: {SHARE}/xarm_description/urdf/xarm7.urdf\nnoise: {{tau: 0.05}}\n"
UR10 = f"""\
model: {SHARE}/ur_description/urdf/ur10_robot.urdf
force_torque_sensors:
  - {{name: wrist, link: tool0, pose: {{xyz: [0, 0, 0], rpy: [0, 0, 0]}},
     axes: [fx, fy, fz, mx, my, mz], polarity: outboard}}
noise: {{tau: 0.05, wrist: [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}}
loads: [{{link: tool0, mass: 0.5, com: [0, 0, 0.05]}}]
"""


@pytest.fixture
def made(tmp_path):
    """A recording of an arm whose inertias are 1.5 % off: (description, recording)."""

    def make(text, seed, change=lambda case: None):
        source, log = tmp_path / "robot.yaml", tmp_path / "log.parquet"
        source.write_text(text)
        case = make_case(tl.load_robot(source), (), np.random.default_rng(seed))
        change(case)
        write_table(log, case.samples, case.robot.description)
        return source, log

    return make


def told(source, log):
    findings = Findings()
    check_recording(tl.load_robot(source), log, findings)
    return findings


@pytest.mark.parametrize(
    ("text", "seed"),
    [(TALOS, 1000), (TALOS, 1003), (PANDA + BASE, 1002), (PANDA + BASE, 1003)],
    ids=["talos-0", "talos-3", "panda-2", "panda-3"],
)
def test_links_that_are_off_as_usual_make_no_heavy_link(made, text, seed):
    assert told(*made(text, seed)).findings == []


def test_an_axis_that_no_load_turns_tells_no_delay(made):
    # A point on the sensor's axis: its moment about that axis is rounding.
    def noisy(case):
        case.samples.tau[:] += 0.15 * case.rng.normal(size=case.samples.tau.shape)

    for seed in range(3):
        assert not any("late" in line for line in told(*made(UR10, seed, noisy)).findings)


def test_what_points_do_not_tell_is_not_known():
    rng = np.random.default_rng(1)
    x = rng.normal(size=50)
    nothing, twice = np.zeros(50), 2.0 * x
    line = robust_line(np.column_stack([x, 1e-17 * rng.normal(size=50)]), x + rng.normal(size=50))
    assert line is not None and line.errors[0] < 0.3 and line.errors[1] > 1e10
    line = robust_line(np.column_stack([x, twice, nothing, np.ones(50)]), x)
    assert line is not None and np.isinf(line.errors[:3]).all() and np.isfinite(line.errors[3])


def _pushed_sideways(case):
    case.samples.wrench[:, 0] += [5.0, -5.0, 0.0, 1.0, 2.0, 0.0]


def _shoulder(case):
    case.samples.tau[:, 0] += 4.0


def _second(case):
    case.samples.tau[:, 1] += 4.0


@pytest.mark.parametrize(
    ("text", "change", "name", "key"),
    [
        (PANDA + BASE, _pushed_sideways, "base", "force_torque_sensors"),
        (UR10, _shoulder, "shoulder_pan_joint", "joints"),
        (PANDA + "noise: {tau: 0.05}\n", _second, "panda_joint2", "joints"),
    ],
    ids=["base", "ur10", "panda"],
)
def test_an_offset_is_no_tilted_base(made, tmp_path, text, change, name, key):
    source, log = made(text, 7, change)
    found = check(source, log)
    assert found.findings and all(name in line and "set bias" in line for line in found.findings)
    assert set(found.fixes) == {key} and set(found.fixes[key]) == {name}
    write_fixes(source, found, tmp_path / "fixed.yaml")
    assert check(tmp_path / "fixed.yaml", log).findings == []


def test_fix_writes_noise_figures(made, tmp_path):
    def noisy(case):
        case.samples.tau[:] += 0.15 * case.rng.normal(size=case.samples.tau.shape)
        case.samples.wrench[:, 0, :3] += 0.2 * case.rng.normal(size=(len(case.samples), 3))

    source, log = made(PANDA + BASE, 3, noisy)
    fixed = tmp_path / "fixed.yaml"
    assert main(["check", str(source), str(log), "--fix", str(fixed)]) == 1
    noise = tl.load_robot(fixed).description.noise
    np.testing.assert_allclose(noise.tau, 0.158, rtol=0.1)
    np.testing.assert_allclose(noise.sensors["base"], [0.206] * 3 + [0.01] * 3, rtol=0.1)
    assert main(["check", str(fixed), str(log)]) == 0


def test_a_hand_that_is_not_mounted_makes_no_offsets(made):
    source, log = made(PANDA + BASE, 11)
    hand = "loads: [{link: panda_leftfinger, mass: 0.8, com: [0, 0, 0.08]}]\n"
    source.write_text(source.read_text() + hand)
    found = told(source, log)
    assert len(found.findings) == 1 and "kg too many" in found.findings[0], found.findings
    assert found.fixes == {}


@pytest.mark.parametrize("what", ["stuck", "clipped"])
def test_a_held_torque_has_no_offset(made, what):
    def hold(case):
        tau = case.samples.tau[:, 2 if what == "stuck" else 1]
        if what == "stuck":
            tau[700:] = tau[700]
        else:
            np.clip(tau, *np.quantile(tau, [0.0, 0.7]), out=tau)

    found = told(*made(UR5, 3, hold))
    assert any(what in line for line in found.findings)
    assert not any("offset" in line or "compensated" in line for line in found.findings)
    assert not found.fixes


def test_torques_that_hold_no_load_are_in_no_unit(made):
    def external(case):
        case.samples.tau[:] = 0.1 * case.rng.normal(size=case.samples.tau.shape)
        case.samples.tau[:] += 0.001 * case.samples.qd

    found = told(*made(XARM7, 50, external))
    assert any("compensated" in line for line in found.findings)
    assert not any("kNm" in line for line in found.findings), found.findings


def test_degrees_of_an_arm_with_joints_that_turn_on_and_on(made):
    def degrees(case):
        case.samples.q[:] = np.degrees(case.samples.q)

    source, log = made(UR5, 4, degrees)
    model = find_robot("ur5").path
    text, turning = model.read_text(), ("shoulder_pan", "elbow", "wrist_1", "wrist_3")
    for name in turning:
        start = f'<joint name="{name}_joint" type="'
        assert f"{start}revolute" in text
        text = text.replace(f"{start}revolute", f"{start}continuous")
    (source.parent / "ur5.urdf").write_text(text)
    source.write_text("model: ur5.urdf\nnoise: {tau: 0.05}\n")
    assert any("look like degrees" in line for line in told(source, log).findings)
