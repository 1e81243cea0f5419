# SPDX-License-Identifier: Apache-2.0
"""A robot made in code, so that a benchmark needs no file: seven joints, two F/T sensors."""

from pathlib import Path

import numpy as np

from touchline.model.description import (
    JointDescription,
    Noise,
    RobotDescription,
    SensorDescription,
)
from touchline.model.mechanism import Inertia, Joint, Link, Mechanism
from touchline.model.robot import Robot
from touchline.model.transforms import pose, pose_rpy

# Per link: offset from the one inboard [m], roll of its axis [rad], mass [kg], length [m].
LINKS = (
    ((0.0, 0.0, 0.13), 0.0, 4.2, 0.18),
    ((0.0, 0.0, 0.18), -np.pi / 2, 4.0, 0.20),
    ((0.0, -0.21, 0.0), np.pi / 2, 3.4, 0.20),
    ((0.0, 0.0, 0.19), np.pi / 2, 3.1, 0.18),
    ((0.0, 0.20, 0.0), -np.pi / 2, 2.6, 0.20),
    ((0.0, 0.0, 0.19), -np.pi / 2, 1.7, 0.10),
    ((0.0, -0.10, 0.0), np.pi / 2, 0.9, 0.08),
)
BASE_MASS, TOOL_MASS = 3.5, 0.7


def sara_like(bandwidth: float = 100.0) -> Robot:
    """An arm of the SARA class: alternating axes, 1.2 m, 24 kg, F/T sensors at base and wrist.

    Args:
        bandwidth: K [rad/s] of all rows.
    """
    links = {"link0": Link("link0", _cylinder(BASE_MASS, 0.13))}
    joints = {}
    for i, (offset, roll, mass, length) in enumerate(LINKS, start=1):
        name = f"link{i}"
        links[name] = Link(name, _cylinder(mass, length))
        placement = pose_rpy(offset, (roll, 0.0, 0.0))
        joints[f"joint{i}"] = Joint(f"joint{i}", "revolute", f"link{i - 1}", name, placement)
    links["tool"] = Link("tool", _cylinder(TOOL_MASS, 0.12))
    mount = pose(p=(0.0, 0.0, 0.09))
    joints["mount"] = Joint("mount", "fixed", "link7", "tool", mount)
    mechanism = Mechanism("sara_like", "link0", links, joints, np.array([0.0, 0.0, -9.81]))
    return Robot(_description(bandwidth), mechanism)


def _description(bandwidth: float) -> RobotDescription:
    sensors = (SensorDescription("base", "link0"), SensorDescription("wrist", "tool"))
    n = len(LINKS)
    axis_noise = (0.05,) * 3 + (0.01,) * 3
    noise = Noise((0.0,) * n, (2e-4,) * n, (0.05,) * n, {s.name: axis_noise for s in sensors})
    return RobotDescription(
        "sara_like",
        Path("sara_like"),
        tuple(JointDescription(f"joint{i + 1}") for i in range(n)),
        sensors,
        noise,
        (bandwidth,) * n,
        {sensor.name: bandwidth for sensor in sensors},
    )


def _cylinder(mass: float, length: float, radius: float = 0.06) -> Inertia:
    """A cylinder along z whose centre is slightly off the axis, as on real links."""
    across = mass * (3 * radius**2 + length**2) / 12
    com = np.array([0.01, -0.015, 0.4 * length])
    return Inertia(mass, com, np.diag([across, 1.1 * across, 0.5 * mass * radius**2]))
