# SPDX-License-Identifier: Apache-2.0
"""Real ROS 2 topics, each side in a process of its own; skipped where ROS 2 is not there."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from live_arms import write_arm
from live_support import assert_same, watch

from touchline.errors import InputError
from touchline.live.ros import Merge
from touchline.logs.naming import parse_naming
from touchline.model.robot import load_robot

HERE = Path(__file__).parent
LOG = "log: {topics: {joint_states: /joint_states, wrench: {wrist: /ft/wrist}}}\n"
needs_ros = pytest.mark.skipif(
    subprocess.run(
        [sys.executable, "-c", "import rclpy"], check=False, capture_output=True
    ).returncode
    != 0,
    reason="ROS 2 is not installed (pip install 'touchline[ros2]')",
)


def environment(domain):
    paths = [str(HERE), str(HERE.parent), os.environ.get("PYTHONPATH", "")]
    return os.environ | {
        "ROS_DOMAIN_ID": str(domain),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "PYTHONPATH": os.pathsep.join(paths),
    }


def beside(robot, domain, options, command):
    """A Python command beside a publisher; status, what it printed, errors."""
    env = environment(domain)
    publisher = [sys.executable, str(HERE / "ros_publisher.py"), str(robot), "60", *options]
    with subprocess.Popen(publisher, env=env, stdout=subprocess.PIPE, text=True) as arm:
        assert arm.stdout is not None
        try:
            assert arm.stdout.readline() == "ready\n"
            done = subprocess.run(
                [sys.executable, *command],
                check=False,
                env=env,
                capture_output=True,
                text=True,
                timeout=50,
            )
        finally:
            arm.kill()
    return done.returncode, done.stdout, done.stderr


def together(robot, domain, options, *arguments):
    """`touchline live` beside a publisher."""
    live = ["-m", "touchline", "live", "--robot", str(robot), "--source", "ros2://"]
    return beside(robot, domain, options, [*live, *arguments])


@needs_ros
@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_topics_are_recorded_and_replayed_to_the_last_bit(tmp_path, suffix):
    robot, path = write_arm(tmp_path, 6, extra=LOG), tmp_path / f"ros{suffix}"
    script = [str(HERE / "ros_watch.py"), str(robot), str(path), str(tmp_path / "seen")]
    status, _, err = beside(robot, 71, ["push"], script)
    assert status == 0, err
    live = pickle.loads((tmp_path / "seen").read_bytes())
    assert len(live.times) > 1000 and len(live.events) >= 1
    replayed = watch(load_robot(robot), f"replay://{path}?speed=0", None, None, True)
    for seen in (live, replayed):  # the native thread had gone on behind the last sample
        seen.events = [e for e in seen.events if e["cleared"] and e["cleared"] <= seen.times[-1]]
    assert live.events
    assert_same(replayed, live)


@needs_ros
def test_a_silent_wrench_and_silent_joints_are_told(tmp_path):
    robot = write_arm(tmp_path, 6, extra=LOG)
    status, out, err = together(robot, 72, ["nowrench"], "--duration", "6")
    assert status == 0, err
    assert "wrist: stale" in out and " 0 events" in out
    status, out, err = together(robot, 73, ["gone"], "--duration", "6")
    assert status == 0, err
    assert "joints: stale" in out and "estimates are withheld" in out and " 0 events" in out


@needs_ros
def test_missing_topics_and_names_are_one_clear_line(tmp_path):
    robot = write_arm(tmp_path, 6, extra=LOG)
    status, out, err = together(robot, 74, ["names"])
    assert status == 2 and "no joint 'joint1'" in err and len(err.strip().splitlines()) == 1
    live = [sys.executable, "-m", "touchline", "live", "--robot", str(robot)]
    done = subprocess.run(
        [*live, "--source", "ros2://?wait=0.5"],
        check=False,
        env=environment(75),
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 2 and "nobody publishes" in done.stderr
    assert len(done.stderr.strip().splitlines()) == 1


# The merging of unsynchronised messages, without ROS.


@pytest.fixture
def merge(tmp_path):
    robot = load_robot(
        write_arm(
            tmp_path,
            2,
            extra="log:\n  joint_names: {joint1: a1}\n  tau: {column: 'x.{joint}', factor: 0.001}\n"
            "  sensors: {wrist: {fx: {column: w, factor: -1.0}}}\n",
        )
    )
    return Merge(robot.description, parse_naming(robot.description))


def state(merge, at, names=("joint2", "spare", "a1"), arrival=None):
    signals = ([2.0, 9.0, 1.0], [0.2, 0.9, 0.1], [2e3, 9e3, 1e3])
    return merge.joints(at, names, signals, at if arrival is None else arrival)


def test_names_and_factors_are_those_of_the_description(merge):
    merge.wrench(0, 0.9995, [1.0, 2.0, 3.0, 4.0, 5.0, 6.0], 0.9995)
    sample = state(merge, 1.0)
    assert sample.q.tolist() == [1.0, 2.0] and sample.qd.tolist() == [0.1, 0.2]
    assert np.allclose(sample.tau, [1.0, 2.0])
    assert sample.wrench[0].tolist() == [-1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert sample.ages[0] == pytest.approx(0.0005) and sample.sequence == 0


def test_the_last_wrench_counts_until_it_is_too_old(merge):
    for i in range(10):
        merge.wrench(0, 0.002 * i, [1.0] * 6, 0.002 * i)
        sample = state(merge, 0.002 * i + 0.001)
        assert np.isfinite(sample.wrench).all()
    assert np.isfinite(state(merge, 0.018 + 0.009).wrench).all()
    assert np.isnan(state(merge, 0.018 + 0.011).wrench).all()


def test_a_wrench_that_comes_late_does_not_replace_a_newer_one(merge):
    merge.wrench(0, 1.000, [1.0] * 6, 1.000)
    merge.wrench(0, 0.998, [2.0] * 6, 1.001)
    assert state(merge, 1.001).wrench[0, 1] == 1.0


def test_a_state_without_all_joints_makes_no_sample(merge):
    assert state(merge, 1.0, ("joint2", "spare", "b")) is None
    assert state(merge, 1.1) is not None
    for i in range(100):  # a gripper on the same topic
        assert state(merge, 1.2 + i, ("f1", "f2", "f3")) is None


def test_joints_that_never_come_are_named(tmp_path):
    robot = load_robot(write_arm(tmp_path, 2))
    merge = Merge(robot.description, parse_naming(robot.description))
    with pytest.raises(InputError, match="no joint 'joint1'.*joint_names"):
        for i in range(100):
            state(merge, 0.1 * i)
