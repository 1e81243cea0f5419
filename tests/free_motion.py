# SPDX-License-Identifier: Apache-2.0
"""Recordings with exact dynamics, made without a simulator."""

from dataclasses import replace

import numpy as np

import touchline as tl
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.trials.free_motion import Trajectory


def smooth_motion(robot, seconds, rate, seed=0, amplitude=0.5):
    """Positions and velocities (N, n) of every joint about the middle of its range."""
    rng = np.random.default_rng(seed)
    joints = [robot.mechanism.joints[name] for name in robot.joint_names]
    lower = np.array([max(joint.lower, -2.0) for joint in joints])
    upper = np.array([min(joint.upper, 2.0) for joint in joints])
    t = np.arange(round(seconds * rate))[:, None] / rate
    w = rng.uniform(0.8, 1.6, len(joints))
    phase = rng.uniform(0, 2 * np.pi, len(joints))
    swing = amplitude * 0.5 * (upper - lower)
    q = 0.5 * (lower + upper) + swing * np.sin(w * t + phase)
    return q, swing * w * np.cos(w * t + phase)


def swaying(joints, amplitude, slowest, fastest):
    """A motion in which every joint goes to and fro, each at a pace of its own [rad, rad/s]."""
    return Trajectory(
        np.linspace(-0.4, 0.5, joints),
        np.full((1, joints), amplitude),
        np.linspace(slowest, fastest, joints)[None, :],
        np.linspace(0.0, 5.0, joints)[None, :],
        (1e-3, 0.0),
    )


def exact_loads(robot, time, q, qd):
    """Torques (N, n) and wrenches (N, k, 6) without contact, as an ideal sensor reads them.

    An observer without lag that is told nothing takes all that moves the arm for external.
    """
    observer = tl.Observer(robot, bandwidth=1e9, method="paper", discretization="exponential")
    n, k = len(robot.joint_names), len(robot.sensor_names)
    nothing = np.zeros((len(time), n)), np.zeros((len(time), k, 6))
    estimate = observer.run(time, q, qd, *nothing)
    tau, wrench = estimate.tau_ext.copy(), estimate.sensor_wrench.copy()
    # Means over the intervals before and after a sample make the value at the sample.
    for values in (tau, wrench):
        values[0] = values[1]
        values[1:-1] = 0.5 * (values[1:-1] + values[2:])
    return tau, wrench


def free_motion(robot, seconds=20.0, rate=200.0, seed=0, noise=0.01):
    """Samples of a robot whose description reads the log as it is (no sign, bias or friction)."""
    q, qd = smooth_motion(robot, seconds, rate, seed)
    time = np.arange(len(q)) / rate
    tau, wrench = exact_loads(robot, time, q, qd)
    rng = np.random.default_rng(seed + 1)
    tau += rng.normal(0, noise, tau.shape)
    wrench += rng.normal(0, noise, wrench.shape)
    return Samples(time, q, qd, tau, wrench)


def pushed(robot, samples, link, rows, force):
    """With a force [N] in world on the origin of a link, as all sensors and joints feel it."""
    q, tau, wrench = samples.q[rows], samples.tau.copy(), samples.wrench.copy()
    places = np.array([robot.T_world_links(x)[link][:3, 3] for x in q])
    forces = np.tile(force, (len(q), 1))
    loads = contact_loads(robot, q, link, np.hstack([forces, np.cross(places, forces)]))
    tau[rows] -= loads.torque
    wrench[rows] -= loads.wrench
    return replace(samples, tau=tau, wrench=wrench)
