# SPDX-License-Identifier: Apache-2.0
"""What the sensors of an arm report that moves and is touched: exact inverse dynamics, no engine.

The dynamics are those of the classical methods (`touchline.observer.dynamics`), which share no
code with the observer.
"""

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads, inverse_dynamics
from touchline.trials.touches import Signals, Touch, add_noise


def moving_signals(
    robot: Robot,
    touches: list[tuple[Touch, float]],
    duration: float,
    speed: float,
    rng: np.random.Generator,
    noise: np.random.Generator | None,
    period: float = 1e-3,
    swing: float = 0.0,
    turning: bool = False,
) -> Signals:
    """What the sensors report while every joint turns and the arm is touched.

    The arm passes through the pose of the touches at the first onset. The points move with their
    links.

    Args:
        robot: the robot.
        touches: each with the time at which it begins [s]; it lasts to the end.
        duration: of the recording [s].
        speed: of every joint [rad/s or m/s], one way or the other.
        rng: source of the ways, and of phases.
        noise: source of the noise of the description; None: without noise.
        period: between samples [s].
        swing: every joint swings this often [Hz], with `speed` at most; 0: it turns steadily.
        turning: forces turn with their links, and so stay in their friction cones; otherwise they
            are constant in world.
    """
    time = np.arange(round(duration / period), dtype=np.float64) * np.float64(period)
    q0, start = touches[0][0].q, min(begin for _, begin in touches)
    rate = speed * rng.choice([-1.0, 1.0], len(q0))
    way, qd, qdd = _swinging(time - start, 2 * np.pi * swing, rate, rng)
    q = q0 + way
    needed = inverse_dynamics(robot, q, qd, qdd)
    tau, wrench = needed.torque, needed.wrench
    for touch, begin in touches:
        points, forces = carried(robot, touch, q)
        pressed = (time >= begin)[:, None] * (forces if turning else touch.force)
        felt = contact_loads(
            robot, q, touch.patch.link, np.hstack([pressed, np.cross(points, pressed)])
        )
        tau, wrench = tau - felt.torque, wrench - felt.wrench
    return add_noise(robot, Signals(time, q, qd, tau, wrench), noise)


def carried(robot: Robot, touch: Touch, q: Array) -> tuple[Array, Array]:
    """A touched point (N, 3) [m] and its force (N, 3) [N] in world, fixed on a link that moves.

    Args:
        robot: the robot.
        touch: at its own joint positions.
        q: joint positions (N, n) [rad or m].
    """
    start = robot.poses(touch.q)[touch.patch.node]
    point = start[:3, :3].T @ (touch.position - start[:3, 3])
    force = start[:3, :3].T @ touch.force
    T = np.array([robot.poses(row)[touch.patch.node] for row in q])
    return T[:, :3, :3] @ point + T[:, :3, 3], T[:, :3, :3] @ force


def _swinging(
    time: Array, pulse: float, rate: Array, rng: np.random.Generator
) -> tuple[Array, Array, Array]:
    """Ways, velocities and accelerations (N, n) of joints that are at 0 at the time 0."""
    if not pulse:
        return np.outer(time, rate), np.tile(rate, (len(time), 1)), np.zeros((len(time), len(rate)))
    phase = rng.uniform(0.0, 2 * np.pi, len(rate))
    angle = pulse * time[:, None] + phase
    way = rate / pulse * (np.sin(angle) - np.sin(phase))
    return way, rate * np.cos(angle), -rate * pulse * np.sin(angle)
