# SPDX-License-Identifier: Apache-2.0
"""What the sensors of an arm report that moves and is touched: exact inverse dynamics, no engine.

The dynamics are those of the classical methods (`touchline.estimation.dynamics`), which share no
code with the observer.
"""

import numpy as np
from numpy.typing import NDArray

from touchline.bench.touches import Signals, Touch, add_noise
from touchline.estimation.dynamics import contact_loads, inverse_dynamics
from touchline.model.robot import Robot

Array = NDArray[np.float64]


def moving_signals(
    robot: Robot,
    touches: list[tuple[Touch, float]],
    duration: float,
    speed: float,
    rng: np.random.Generator,
    noise: np.random.Generator | None,
    period: float = 1e-3,
) -> Signals:
    """What the sensors report while every joint turns steadily and the arm is touched.

    The arm passes through the pose of the touches at the first onset. The points move with their
    links, the forces are constant in world.

    Args:
        robot: the robot.
        touches: each with the time at which it begins [s]; it lasts to the end.
        duration: of the recording [s].
        speed: of every joint [rad/s or m/s], one way or the other.
        rng: source of the ways.
        noise: source of the noise of the description; None: without noise.
        period: between samples [s].
    """
    time = np.arange(round(duration / period), dtype=np.float64) * np.float64(period)
    q0, start = touches[0][0].q, min(begin for _, begin in touches)
    rate = speed * rng.choice([-1.0, 1.0], len(q0))
    q = q0 + np.outer(time - start, rate)
    qd = np.tile(rate, (len(time), 1))
    needed = inverse_dynamics(robot, q, qd, np.zeros_like(q))
    tau, wrench = needed.torque, needed.wrench
    for touch, begin in touches:
        pressed = (time >= begin)[:, None] * touch.force
        points = _carried(robot, touch, q)
        felt = contact_loads(
            robot, q, touch.patch.link, np.hstack([pressed, np.cross(points, pressed)])
        )
        tau, wrench = tau - felt.torque, wrench - felt.wrench
    return add_noise(robot, Signals(time, q, qd, tau, wrench), noise)


def _carried(robot: Robot, touch: Touch, q: Array) -> Array:
    """The touched point (N, 3) [m] in world as its link moves."""
    start = robot.poses(touch.q)[touch.patch.node]
    local = np.append(start[:3, :3].T @ (touch.position - start[:3, 3]), 1.0)
    return np.array([(robot.poses(row)[touch.patch.node] @ local)[:3] for row in q])
