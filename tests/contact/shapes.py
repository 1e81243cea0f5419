# SPDX-License-Identifier: Apache-2.0
"""Robots of simple shapes, whose contacts can be worked out by hand."""

import numpy as np

from touchline.localizer.skin import Skin
from touchline.model.description import (
    JointDescription,
    Noise,
    RobotDescription,
    SensorDescription,
)
from touchline.model.mechanism import Geometry, Inertia, Joint, Link, Mechanism
from touchline.model.robot import Robot
from touchline.model.transforms import pose, rotation_rpy
from touchline.observer.observer import Observer
from touchline.trials.touches import Touch, resting_signals

BODY = Inertia(1.0, np.zeros(3), np.eye(3) * 0.01)


def box(*size, at=(0.0, 0.0, 0.0)):
    return Geometry("box", pose(p=at), tuple(size))


def sphere(radius, at=(0.0, 0.0, 0.0)):
    return Geometry("sphere", pose(p=at), (radius,))


def describe(mechanism, sensors, torque="sensor", qd=1e-4, graspable=()):
    names = [joint.name for joint in mechanism.joints.values()]
    n = len(names)
    return Robot(
        RobotDescription(
            name=mechanism.name,
            model=None,
            joints=tuple(JointDescription(name, torque=torque) for name in names),
            sensors=tuple(SensorDescription(name, link) for name, link in sensors),
            noise=Noise(
                (0.0,) * n,
                (qd,) * n,
                (0.05,) * n,
                {name: (0.05,) * 3 + (0.01,) * 3 for name, _ in sensors},
            ),
            graspable=graspable,
            bandwidth_joints=(100.0,) * n,
            bandwidth_sensors={name: 100.0 for name, _ in sensors},
        ),
        mechanism,
    )


def still(shape, graspable=()):
    """One link with one shape, bolted to a sensor."""
    mechanism = Mechanism("still", "body", {"body": Link("body", BODY, (shape,))}, {}, np.zeros(3))
    return describe(mechanism, [("base", "body")], graspable=graspable)


def chain(lengths=(0.3, 0.3, 0.3), sensors=(("base", "link0"),), torque="sensor", graspable=()):
    """Boxes in a row along x on joints whose axes alternate between y and z."""
    links = {"link0": Link("link0", BODY, (box(0.1, 0.1, 0.1),))}
    joints = {}
    for i, length in enumerate(lengths):
        name = f"link{i + 1}"
        shape = box(length - 0.04, 0.08, 0.08, at=(length / 2, 0, 0))
        links[name] = Link(name, BODY, (shape,))
        axis = np.array([0.0, 1.0, 0.0]) if i % 2 == 0 else np.array([0.0, 0.0, 1.0])
        at = (0.06 if i == 0 else lengths[i - 1], 0.0, 0.0)
        joints[f"joint{i + 1}"] = Joint(
            f"joint{i + 1}", "revolute", f"link{i}", name, pose(p=at), axis
        )
    mechanism = Mechanism("chain", "link0", links, joints, np.array([0.0, 0.0, -9.81]))
    return describe(mechanism, list(sensors), torque, graspable=graspable)


def measured(robot, q, loads, rng=None, duration=0.3):
    """The last estimate of a recording at rest under `loads`: (link, position, force)."""
    skin = Skin(robot)
    patches = {patch.link: patch for patch in skin.patches}
    touches = [
        (Touch(q, patches[link], np.asarray(x, float), np.zeros(3), np.asarray(f, float)), 0.0)
        for link, x, f in loads
    ]
    s = resting_signals(robot, np.asarray(q, float), touches, duration, rng)
    observer = Observer(robot)
    rows = observer.run(s.time, s.q, s.qd, s.tau, s.wrench).rows
    return observer, observer.estimate(rows[-1]), skin


def turned(shape, rpy, shift):
    return Geometry(shape.kind, pose(rotation_rpy(rpy), shift) @ shape.T_link_shape, shape.size)
