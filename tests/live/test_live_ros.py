# SPDX-License-Identifier: Apache-2.0
"""Real ROS 2 topics, each side in a process of its own; skipped where ROS 2 is not there."""

import os
import pickle
import subprocess
import sys
from pathlib import Path

import pytest
from live_arms import write_arm
from live_support import assert_same, watch

from touchline.model.robot import load_robot

HERE = Path(__file__).parent
LOG = "log: {topics: {joint_states: /joint_states, wrench: {wrist: /ft/wrist}}}\n"
FOUND = subprocess.run([sys.executable, "-c", "import rclpy"], check=False, capture_output=True)
# `make test-live` wants them all: without ROS 2 they fail there.
needs_ros = pytest.mark.skipif(
    FOUND.returncode != 0 and "REQUIRE_ROS" not in os.environ,
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
    reliable = ["-m", "touchline", "live", "--robot", str(robot), "--source", "ros2://?reliable=1"]
    status, out, err = beside(robot, 74, [], reliable)
    assert status == 2 and "publishes best effort, and reliable=1 cannot match" in err
    assert len(err.strip().splitlines()) == 1
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
