# SPDX-License-Identifier: Apache-2.0
"""The observer benchmark measures what it says; no test asserts a time."""

import importlib.util
import json

import numpy as np
import pinocchio as pin
import pytest
from robots import describe, random_mechanism, random_robot

from touchline.bench.observer import run as bench
from touchline.bench.observer.discretization import discretization_errors, filtered, fixed_sensor
from touchline.bench.observer.run import main, plain, run_benchmark
from touchline.bench.observer.timing import Candidate, measure
from touchline.bench.pinocchio_peer import PinocchioObserver
from touchline.bench.urdf import robot_urdf, sensor_link
from touchline.errors import InputError
from touchline.model.description import JointDescription, SensorDescription
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads
from touchline.observer.observer import Observer
from touchline.trials.fast_motion import fast_motion, pushed_link, two_sensor_arm


@pytest.fixture(scope="module")
def result():
    return run_benchmark(rounds=1)


def test_the_peers_compute_the_same_residuals(result):
    names = [agreement.name for agreement in result.agreements]
    assert sum("Pinocchio" in name for name in names) == 3
    assert all(agreement.difference < 1e-9 for agreement in result.agreements)


def test_the_table_names_every_candidate_with_known_figures(result):
    text = str(result)
    for timing in result.timings:
        assert timing.name in text and 0 < timing.minimum <= timing.median
    for name in ("Observer.run", "Observer.update", "native step", "Pinocchio in Python", "Tustin"):
        assert name in text
    assert "27-79" in text and "iDynTree" in text.replace("idyntree", "iDynTree")
    assert result.ratio("Observer.update") == 1.0


def test_a_missing_peer_is_one_line_that_says_how_to_install_it(monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = run_benchmark(rounds=1, accuracy=False)
    assert result.notes == [
        "pinocchio is not installed: pip install pin",
        "idyntree is not installed: pip install idyntree",
    ]
    assert len(result.timings) == 4 and result.errors == [] and result.agreements == []
    assert result.notes[0] in str(result)


def test_a_robot_with_mimics_keeps_our_own_rows():
    mechanism = random_mechanism(np.random.default_rng(8))
    rows = tuple(JointDescription(f"joint{i}") for i in range(1, 8))
    robot = Robot(describe(mechanism, [("base", "link0")], joints=rows), mechanism)
    robot.nodes[-1].multiplier = 2.0
    assert bench._has_mimics(robot) and not bench._has_mimics(two_sensor_arm())


def test_results_are_written(result, tmp_path):
    result.write(tmp_path / "a" / "bench.json")
    found = json.loads((tmp_path / "a" / "bench.json").read_text())
    assert found["timings"][0]["name"] == "Observer.run"
    result.write(tmp_path / "bench.csv")
    lines = (tmp_path / "bench.csv").read_text().splitlines()
    assert lines[0] == "name,median_us,min_us" and len(lines) == 1 + len(result.timings)


def test_bad_options_are_refused_before_anything_runs(tmp_path, capsys):
    with pytest.raises(InputError, match=r"bench.txt', allowed endings: .json, .csv"):
        main(tmp_path / "bench.txt")
    with pytest.raises(InputError, match="--rounds 0: must be at least 1"):
        main(rounds=0)
    assert capsys.readouterr().out == ""


def test_the_command_prints_and_writes(tmp_path, capsys):
    assert main(tmp_path / "bench.json", rounds=1) == 0
    assert "x update" in capsys.readouterr().out
    assert (tmp_path / "bench.json").exists()


def test_trapezoid_forms_are_second_order_and_the_others_first():
    errors = {(e.name, e.rate): e.force for e in discretization_errors(two_sensor_arm())}
    gain = {name: errors[name, 1000.0] / errors[name, 8000.0] for name, _ in errors}
    assert gain["Euler"] == pytest.approx(8.0, rel=0.1)
    assert gain["rectangle"] == pytest.approx(8.0, rel=0.1)
    assert gain["Tustin"] == pytest.approx(64.0, rel=0.1)
    assert gain["exponential-trapezoid"] == pytest.approx(64.0, rel=0.1)
    assert errors["Tustin", 1000.0] < 1e-3 < 0.1 < errors["Euler", 1000.0]


def test_the_exact_filter_answers_a_step_and_a_ramp():
    time = np.arange(200) * 1e-3
    step = filtered(np.ones((200, 1)), 50.0, 1e-3)[:, 0]
    np.testing.assert_allclose(step, 1 - np.exp(-50 * time), atol=1e-12)
    ramp = filtered(time[:, None], 50.0, 1e-3)[:, 0]
    np.testing.assert_allclose(ramp, time - (1 - np.exp(-50 * time)) / 50, atol=1e-12)


def test_the_sensor_that_stands_still_is_found():
    assert fixed_sensor(two_sensor_arm()) == 0
    mechanism = random_mechanism(np.random.default_rng(1), chain=True)
    robot = Robot(describe(mechanism, [("tip", "link7")]), mechanism)
    assert fixed_sensor(robot) is None and discretization_errors(robot) == []


def test_plain_leaves_the_mechanism_and_drops_the_settings():
    arm = two_sensor_arm()
    sensors = (SensorDescription("base", "link0", axes=("fz",), polarity="inboard"),)
    rows = (JointDescription("joint1", "none"), *arm.description.joints[1:])
    robot = plain(Robot(describe(arm.mechanism, sensors, joints=rows), arm.mechanism))
    assert robot.description.joints[0].torque == "sensor"
    assert len(robot.description.sensors[0].axes) == 6
    assert robot.joint_names == arm.joint_names and robot.segment_names == ("base",)


@pytest.mark.parametrize("seed", range(4))
def test_the_pinocchio_peer_follows_any_tree(seed):
    robot = random_robot(seed, sensors=3)
    motion = fast_motion(robot, 1000.0, 0.1)
    joints, sensors, segments = PinocchioObserver(robot, 50.0).run(*motion.signals())
    ours = Observer(robot, bandwidth=50.0, method="paper").run(*motion.signals())
    np.testing.assert_allclose(joints, ours.tau_ext, atol=1e-9)
    np.testing.assert_allclose(sensors, ours.sensor_wrench, atol=1e-9)
    np.testing.assert_allclose(segments, ours.segment_wrench, atol=1e-9)


def test_candidates_are_timed_in_turns():
    calls = []
    candidates = [Candidate(name, lambda name=name: calls.append(name), 1) for name in "ab"]
    timings = measure(candidates, rounds=3)
    assert calls == ["a", "a", "b", "b"] * 3  # the first of each two does not count
    assert [timing.name for timing in timings] == ["a", "b"]


@pytest.mark.parametrize("seed", range(3))
def test_the_urdf_is_the_robot(seed):
    robot = random_robot(seed)
    model = pin.buildModelFromXML(robot_urdf(robot))
    data, q = model.createData(), np.random.default_rng(seed).uniform(-1, 1, 7)
    position = pin.neutral(model)
    for name, value in zip(robot.joint_names, q, strict=True):
        joint = model.joints[model.getJointId(name)]
        turning = joint.nq == 2  # an unbounded joint: cosine and sine
        where = slice(joint.idx_q, joint.idx_q + joint.nq)
        position[where] = [np.cos(value), np.sin(value)] if turning else [value]
    pin.framesForwardKinematics(model, data, position)
    poses = robot.poses(q)
    for name in robot.sensor_names:
        node = next(i for i, node in enumerate(robot.nodes) if node.sensor == name)
        found = data.oMf[model.getFrameId(sensor_link(name))].homogeneous
        np.testing.assert_allclose(found, poses[node], atol=1e-9)
    model.gravity = pin.Motion(robot.gravity, np.zeros(3))
    weight = pin.computeGeneralizedGravity(model, data, position)
    order = [model.joints[model.getJointId(name)].idx_v for name in robot.joint_names]
    np.testing.assert_allclose(weight[order], gravity_loads(robot, q).torque, atol=1e-9)


def test_idyntree_recovers_the_push():
    pytest.importorskip("idyntree", reason="idyntree is not installed: pip install idyntree")
    from touchline.bench.idyntree_peer import IdyntreeEstimator

    robot = two_sensor_arm()
    motion = fast_motion(robot, 100.0)
    peer = IdyntreeEstimator(robot)
    states = zip(motion.q, motion.qd, motion.qdd, motion.wrench, strict=True)
    found = np.array([peer.update(*state) for state in states])
    assert robot.body_of(pushed_link(robot)).segment == "base"
    np.testing.assert_allclose(found, motion.sensor_ext, atol=1e-9)
