# SPDX-License-Identifier: Apache-2.0
"""The ROS 2 node, with a listener in a process of its own; skipped where ROS 2 is not there."""

import json
import subprocess
import sys

from test_live_ros import HERE, environment, needs_ros

import touchline as tl
from touchline.live.messages import wrench_topic
from touchline.model.interface_names import GESTURES


@needs_ros
def test_what_is_felt_is_published_and_services_answer(tmp_path):
    env = environment(76)
    robot = tmp_path / "robot.yaml"
    sara = tl.load_robot("sara").description.path.read_text()
    robot.write_text(f"{sara.replace('sara.urdf', 'robot:sara')}\n{LAMP}\n")
    listener = [sys.executable, str(HERE / "ros_listener.py"), "10"]
    parameters = [
        "-p",
        f"robot:={robot}",
        "-p",
        "source:=sim://?motion=0",
        "-p",
        "publish_rate:=100.0",
    ]
    parameters += [
        "-p",
        "load_link:=tool",
        "-p",
        "load_mass:=0.5",
        "-p",
        "load_com:=[0.0, 0.0, 0.04]",
    ]
    command = [sys.executable, "-m", "touchline.live.node", "--ros-args", *parameters]
    with (
        subprocess.Popen(listener, env=env, stdout=subprocess.PIPE, text=True) as ear,
        subprocess.Popen(command, env=env, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as node,
    ):
        try:
            out, _ = ear.communicate(timeout=120)
        finally:
            node.terminate()
            node.communicate(timeout=30)
            ear.kill()
    told = json.loads(out.splitlines()[-1])
    assert all(count > 0 for count in told["heard"].values()), told
    assert told["names"] == [f"joint{i}" for i in range(1, 8)] and told["efforts"] == 7
    assert told["links"] and "force" in told["shapes"]
    assert told["status"][0] == "touchline: simulation" and float(told["facts"]["rate_hz"]) > 0
    assert 0.0 < float(told["facts"]["gate_ratio"]) < 1.0
    assert told["facts"]["resets"].isdigit()
    assert set(told["touches"]) <= {*GESTURES, "press", "release", "toggle"} and told["touches"]
    assert told["collision"] in (True, False)
    assert told["answers"]["reset"] == [True, "reset: the estimate starts anew"]
    assert told["answers"]["tare"][1].startswith("tare")  # done, or the arm was not at rest
    assert told["answers"]["set_load"] == [True, LOADED]


LAMP = "interface: {lamp: {kind: toggle, link: link3}}"
LOADED = "set_load: tool carries 0.500 kg at (+0.000, +0.000, +0.040) m of its frame"


@needs_ros
def test_a_node_with_a_bad_parameter_says_so_and_ends():
    command = [sys.executable, "-m", "touchline.live.node", "--ros-args", "-p"]
    for parameter, words in (
        ("robot:=no_such_robot", "no_such_robot"),
        ("source:=nowhere://", "parameter robot"),
    ):
        done = subprocess.run(
            [*command, parameter],
            check=False,
            env=environment(77),
            capture_output=True,
            text=True,
            timeout=60,
        )
        assert done.returncode == 2 and words in done.stderr and "Traceback" not in done.stderr


def test_topics_of_segments_are_names_that_ros_allows():
    assert wrench_topic("base") == "~/base/wrench"
    assert wrench_topic("3-axis sensor") == "~/_3_axis_sensor/wrench"


def test_without_ros_the_node_says_what_to_install(monkeypatch, capsys):
    from touchline.live.node import main

    monkeypatch.setitem(sys.modules, "rclpy", None)
    assert main([]) == 2
    assert "touchline[ros2]" in capsys.readouterr().err
