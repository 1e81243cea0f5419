# SPDX-License-Identifier: Apache-2.0
"""Prescribed motions with exact inverse dynamics and known external forces."""

import numpy as np
from oracle import PinocchioTwin


def trajectory(time, n, speed=1.0, seed=0):
    """Smooth joint motion (N, n): positions, velocities, accelerations."""
    rng = np.random.default_rng(seed)
    w = rng.uniform(1.0, 3.0, n) * speed
    a = rng.uniform(0.3, 0.8, n)
    phase = rng.uniform(0, 6, n)
    x = time[:, None] * w + phase
    return a * np.sin(x), a * w * np.cos(x), -a * w**2 * np.sin(x)


def ramp(time, start, length=0.1, stop=np.inf):
    """0 to 1 within `length` from `start` on, and back from `stop` on."""
    return np.clip((time - start) / length, 0, 1) - np.clip((time - stop) / length, 0, 1)


def first_order(time, signal, bandwidth, fine):
    """The exactly filtered signal at `time`, given on the grid `fine` (integrated finely)."""
    dt = fine[1] - fine[0]
    a = np.exp(-bandwidth * dt)
    # Exact for a signal that is linear between the fine samples.
    k = (1 - a) / (bandwidth * dt)
    out = np.zeros_like(signal)
    for i in range(1, len(fine)):
        out[i] = a * out[i - 1] + (k - a) * signal[i - 1] + (1 - k) * signal[i]
    return out[:: round((time[1] - time[0]) / dt)][: len(time)]


class Recording:
    """What ideal sensors of a robot report while forces act at points fixed on bodies.

    `contacts`: (joint or sensor that carries the body, point in world at q = 0 of that moment,
    force(t) in world); the point is a function of time in world.
    """

    def __init__(self, robot, time, contacts=(), speed=1.0, seed=0):
        self.robot, self.time = robot, time
        twin = PinocchioTwin(robot.description, robot.mechanism)
        n, k = len(robot.joint_names), len(robot.sensor_names)
        self.q, self.qd, self.qdd = trajectory(time, n, speed, seed)
        loads = np.empty((len(time), n + 6 * k))
        self.external = np.zeros_like(loads)
        for i in range(len(time)):
            loads[i] = twin.loads(self.q[i], self.qd[i], self.qdd[i])
            for carrier, point, force in contacts:
                f = force(time[i])
                if np.any(f):
                    J = twin.jacobian_world(self.q[i], carrier, point(time[i]))
                    self.external[i] += f @ J
        self.tau = (loads - self.external)[:, :n]
        self.wrench = (loads - self.external)[:, n:].reshape(-1, k, 6)

    def signals(self):
        return self.time, self.q, self.qd, self.tau, self.wrench
