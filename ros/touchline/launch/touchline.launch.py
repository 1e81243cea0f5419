# SPDX-License-Identifier: Apache-2.0
"""Starts the node: `ros2 launch touchline_ros touchline.launch.py robot:=robot.yaml`."""

import sys
from pathlib import Path

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, ExecuteProcess
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration

RVIZ = Path(__file__).parents[1] / "rviz" / "touchline.rviz"
ARGUMENTS = {
    "robot": (None, "robot.yaml, or the name of a robot that ships with Touchline"),
    "source": ("ros2://", "as `touchline live --source` takes it"),
    "record": ("", "a .mcap or .parquet for every sample; empty: none"),
    "frame": ("world", "name of the world frame"),
    "rviz": ("false", "whether RViz is started"),
}


def generate_launch_description():
    """What is started."""
    declared = [
        DeclareLaunchArgument(name, default_value=value, description=text)
        if value is not None
        else DeclareLaunchArgument(name, description=text)
        for name, (value, text) in ARGUMENTS.items()
    ]
    command = [sys.executable, "-m", "touchline.live.node", "--ros-args"]
    for name in ("robot", "source", "record", "frame"):
        command += ["-p", [f"{name}:='", LaunchConfiguration(name), "'"]]
    node = ExecuteProcess(cmd=command, output="screen")
    rviz = ExecuteProcess(
        cmd=["rviz2", "-d", str(RVIZ)], condition=IfCondition(LaunchConfiguration("rviz"))
    )
    return LaunchDescription([*declared, node, rviz])
