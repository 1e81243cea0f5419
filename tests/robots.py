# SPDX-License-Identifier: Apache-2.0
"""Robots made for tests: random trees with random sensors."""

from pathlib import Path

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.model.description import (
    JointDescription,
    Noise,
    RobotDescription,
    SensorDescription,
)
from touchline.model.mechanism import Inertia, Joint, Link, Mechanism
from touchline.model.robot import Robot, load_robot
from touchline.model.transforms import pose, rotation_rpy

EXAMPLES = Path(__file__).parents[1] / "examples" / "robots"


def load_example(name):
    """A robot of examples/robots; skips where its model is not on this machine."""
    try:
        return load_robot(EXAMPLES / f"{name}.yaml")
    except InputError as error:
        pytest.skip(f"{name}: {error}")


def random_pose(rng, scale=0.3):
    return pose(rotation_rpy(rng.uniform(-3, 3, 3)), rng.normal(size=3) * scale)


def random_inertia(rng):
    moments = rng.uniform(0.002, 0.02, 3)
    R = rotation_rpy(rng.uniform(-3, 3, 3))
    spread = np.diag(moments.sum() - moments)  # second moments: the triangle inequality holds
    return Inertia(rng.uniform(0.3, 4.0), rng.normal(size=3) * 0.1, R @ spread @ R.T)


def random_mechanism(rng, movable=7, chain=False):
    """A tree with `movable` moving joints and a fixed joint after every other one."""
    links = {"link0": Link("link0", random_inertia(rng))}
    joints = {}
    names = ["link0"]
    for i in range(movable):
        parent = names[-1] if chain else str(rng.choice(names))
        kind = "revolute" if chain or rng.random() < 0.8 else "prismatic"
        axis = rng.normal(size=3)
        name = f"link{i + 1}"
        links[name] = Link(name, random_inertia(rng))
        joints[f"joint{i + 1}"] = Joint(
            f"joint{i + 1}", kind, parent, name, random_pose(rng), axis / np.linalg.norm(axis)
        )
        names.append(name)
        if i % 2:
            extra = f"plate{i + 1}"
            links[extra] = Link(extra, random_inertia(rng))
            joints[f"weld{i + 1}"] = Joint(
                f"weld{i + 1}", "fixed", name, extra, random_pose(rng, 0.1)
            )
            names.append(extra)
    return Mechanism("random", "link0", links, joints, np.array([0.3, -0.2, -9.7]))


def describe(mechanism, sensors, bandwidth=50.0, joints=None, **options):
    """A description with all moving joints observed, and sensors given as (name, link, pose)."""
    movable = [j.name for j in mechanism.joints.values() if j.kind != "fixed"]
    rows = joints or tuple(JointDescription(name) for name in movable)
    n = len(rows)
    sensor_rows = tuple(
        s if isinstance(s, SensorDescription) else SensorDescription(*s) for s in sensors
    )
    noise = Noise(
        (0.0,) * n,
        (2e-4,) * n,
        (0.05,) * n,
        {s.name: (0.05,) * 3 + (0.01,) * 3 for s in sensor_rows},
    )
    return RobotDescription(
        mechanism.name,
        Path("none"),
        rows,
        sensor_rows,
        noise,
        (bandwidth,) * n,
        {s.name: bandwidth for s in sensor_rows},
        **options,
    )


def random_robot(seed, sensors=3, chain=False, bandwidth=50.0, movable=7):
    """A random robot with `sensors` six-axis sensors at random links; the first at the root."""
    rng = np.random.default_rng(seed)
    mechanism = random_mechanism(rng, movable=movable, chain=chain)
    links = list(mechanism.links)
    chosen = ["link0", *rng.choice(links[1:], size=sensors - 1, replace=False)]
    rows = [
        SensorDescription(
            f"sensor{i}", str(link), tuple(rng.normal(size=3) * 0.1), tuple(rng.uniform(-3, 3, 3))
        )
        for i, link in enumerate(chosen)
    ]
    return Robot(describe(mechanism, rows, bandwidth), mechanism)
