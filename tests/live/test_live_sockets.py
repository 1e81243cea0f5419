# SPDX-License-Identifier: Apache-2.0
"""Nothing listens to other machines unless it is told to."""

import subprocess
import sys
import time
from pathlib import Path

import pytest
from fake_rtde import FakeController
from live_arms import make_arm, pushed, write_arm
from sockets import LOOPBACK, family, listening
from test_live_ros import HERE, environment, needs_ros

pytestmark = pytest.mark.skipif(not Path("/proc/net/tcp").exists(), reason="Linux only")


def opened(command, env=None, word="live;"):
    """Sockets of a process, once it has printed a word."""
    with subprocess.Popen(
        [sys.executable, "-m", *command], env=env, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None
        try:
            for line in process.stdout:
                if word in line:
                    break
            time.sleep(0.5)
            assert process.poll() is None, "it has ended, and listens nowhere for that reason"
            return [entry for pid in family(process.pid) for entry in listening(pid)]
        finally:
            process.kill()


def test_reading_a_robot_listens_nowhere(tmp_path):
    assert opened(["touchline", "live", "--robot", "sara", "--source", "sim://"]) == []
    arm = make_arm(tmp_path, 6)
    with FakeController(pushed(arm, seconds=1.0, begin=1e3)) as controller:
        source = ["--source", controller.address, "--robot", str(tmp_path / "robot.yaml")]
        assert opened(["touchline", "live", *source]) == []


def test_the_page_is_served_on_the_loopback():
    pytest.importorskip("viser")
    found = opened(
        ["touchline", "live", "--robot", "sara", "--source", "sim://", "--view", "--no-browser"]
    )
    assert found and all(address in LOOPBACK for _, address, _ in found), found


@needs_ros
def test_topics_are_read_on_the_loopback(tmp_path):
    robot, env = write_arm(tmp_path, 6), environment(79)
    publisher = [sys.executable, str(HERE / "ros_publisher.py"), str(robot), "60"]
    with subprocess.Popen(publisher, env=env, stdout=subprocess.PIPE) as arm:
        try:
            del env["ROS_AUTOMATIC_DISCOVERY_RANGE"]
            source = ["--source", "ros2://", "--robot", str(robot)]
            found = opened(["touchline", "live", *source], env)
        finally:
            arm.kill()
    receiving = [entry for entry in found if entry[2] in range(7000, 32000)]
    assert receiving and all(address in LOOPBACK for _, address, _ in receiving), found


@needs_ros
def test_ros_listens_on_the_loopback_unless_told_otherwise():
    env = environment(78)
    for name in ("ROS_AUTOMATIC_DISCOVERY_RANGE", "FASTDDS_DEFAULT_PROFILES_FILE"):
        env.pop(name, None)
    parameters = ["--ros-args", "-p", "robot:=sara", "-p", "source:=sim://"]
    process = subprocess.Popen(
        [sys.executable, "-m", "touchline.live.node", *parameters],
        env=env,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )
    try:
        end = time.monotonic() + 20.0
        while not (found := listening(process.pid)) and time.monotonic() < end:
            time.sleep(0.5)
        time.sleep(2.0)
        found = listening(process.pid)
    finally:
        process.kill()
        process.wait()
    receiving = [entry for entry in found if entry[2] in range(7000, 32000)]
    assert receiving and all(address in LOOPBACK for _, address, _ in receiving), found
