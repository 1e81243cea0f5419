# SPDX-License-Identifier: Apache-2.0
"""A motion for calibration keeps the limits, says what it will tell, and is right about it."""

import json
import runpy

import numpy as np
import pytest
import yaml
from free_motion import exact_loads
from robots import load_example

from touchline.calibrate.plan import EFFORT_SHARE, make_plan, write_plan
from touchline.cli.main import main
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.observer.dynamics import inverse_dynamics
from touchline.observer.samples import Samples


@pytest.fixture(scope="module")
def plan():
    return make_plan(load_example("panda_hand"))


def test_the_motion_keeps_the_limits(plan):
    low, high = plan.robot.ranges
    assert (plan.q > low).all() and (plan.q < high).all()
    joints = [plan.robot.mechanism.joints[name] for name in plan.robot.joint_names]
    assert (np.abs(plan.qd) <= 0.5 * np.array([joint.velocity for joint in joints])).all()
    torque = inverse_dynamics(plan.robot, plan.q, plan.qd, plan.qdd).torque
    effort = np.array([joint.effort for joint in joints])
    assert (np.abs(torque) <= 1.05 * EFFORT_SHARE * effort).all()


def test_the_motion_is_its_own_derivative_and_rests_at_both_ends(plan):
    np.testing.assert_allclose(np.gradient(plan.q, plan.time, axis=0), plan.qd, atol=0.01)
    np.testing.assert_allclose(np.gradient(plan.qd, plan.time, axis=0), plan.qdd, atol=0.1)
    assert np.abs(plan.qd[[0, -1]]).max() < 1e-9 and np.abs(plan.qdd[[0, -1]]).max() < 1e-9


def test_what_is_held_out_of_the_motion_is_not_what_was_fitted(plan):
    """Most postures of the last third, which ends where the motion began, are apart from others."""
    before, last = np.split(plan.q[::20], [2 * len(plan.q[::20]) // 3])
    apart = np.linalg.norm(last[:, None] - before, axis=2).min(axis=1)
    assert np.median(apart) > 0.5


def test_the_motion_shows_many_postures(plan):
    low, high = plan.robot.ranges
    assert (np.ptp(plan.q, axis=0) > 0.4 * np.minimum(high - low, 4.0)).all()


def test_every_file_holds_the_same_motion(plan, tmp_path):
    write_plan(plan, tmp_path)
    table = np.loadtxt(tmp_path / "motion.csv", delimiter=",", skiprows=1)
    np.testing.assert_allclose(table[:, 1:8], plan.q, atol=1e-5)
    points = json.loads((tmp_path / "motion.json").read_text())["points"]
    np.testing.assert_allclose([p["positions"] for p in points], plan.q, atol=1e-6)
    head = (tmp_path / "motion.yaml").read_text().splitlines()[:10]
    assert yaml.safe_load("\n".join(head)) == {
        "joint_names": list(plan.robot.joint_names),
        "points": points[:2],
    }
    listed = runpy.run_path(str(tmp_path / "motion.py"))["POINTS"]
    np.testing.assert_allclose([q for _, q in listed], plan.q, atol=1e-6)


def test_offsets_and_friction_are_found_within_what_was_foretold(plan):
    tau, wrench = exact_loads(plan.robot, plan.time, plan.q, plan.qd)
    rng = np.random.default_rng(0)
    tau += 0.05 * rng.normal(size=tau.shape)
    tau[:, 2] += 0.4 + 1.0 * np.tanh(plan.qd[:, 2] / 0.05)
    samples = Samples(plan.time, plan.q, plan.qd, tau, wrench)
    found = identify(gather(plan.robot, [[samples]])).solution
    foretold = {name: error for name, error, _ in plan.errors}
    assert abs(found.value("bias", 2) - 0.4) < 2 * foretold["offsets of joints, the worst joint"]
    worst = foretold["Coulomb friction, the worst joint"]
    assert abs(found.value("coulomb", 2) - 1.0) < 2 * worst


def test_poses_for_sensors_show_gravity_from_all_sides(tmp_path, capsys):
    assert main(["calibrate", "--plan", "sara", "--out", str(tmp_path)]) == 0
    assert "bias of wrist.fx" in capsys.readouterr().out
    import touchline as tl

    robot = tl.load_robot("sara")
    poses = np.loadtxt(tmp_path / "poses.csv", delimiter=",", skiprows=1)
    wrist = robot.sensor_names.index("wrist")
    down = np.array([-robot.sensor_poses(q)[wrist, 2, :3] for q in poses])
    assert np.linalg.svd(down - down.mean(axis=0))[1][-1] > 1.0


def test_a_calibration_needs_a_robot(capsys):
    assert main(["calibrate", "log.csv"]) == 2
    assert "--plan ROBOT" in capsys.readouterr().err
