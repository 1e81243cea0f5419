# SPDX-License-Identifier: Apache-2.0
"""From logged numbers to what acts on the model, for whole recordings, in numpy.

The same rules as the native core's (`signals.hpp`), for the baselines.
"""

import numpy as np

from touchline.arrays import Array
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.observer.dynamics import Posture, gravity_loads


def read_torque(robot: Robot, q: Array, qd: Array, tau: Array) -> Array:
    """Joint torques (N, n) [Nm] without friction, from logged ones.

    Applies sign, gain, bias, friction and what was learned beside it. What the driver has taken out
    stays out; joints without a torque signal are NaN.
    """
    read = np.full(tau.shape, np.nan)
    for j, joint in enumerate(robot.description.joints):
        if not joint.measured:
            continue
        law, speed = joint.friction, qd[:, j]
        friction = law.dry(speed) + law.viscous * speed
        read[:, j] = joint.sign * joint.gain * tau[:, j] - joint.bias - friction
        if joint.rest is not None:
            read[:, j] -= joint.rest.at(q[:, j], speed)
    return read


def read_wrench(robot: Robot, placed: Posture, q: Array, wrench: Array) -> Array:
    """Wrenches (N, k, 6) on the outboard bodies, sensor frame, from logged ones.

    Applies axes, polarity, bias and the axes of the log, and puts back the weight where a driver
    has taken it out. An axis that a sensor lacks is NaN.
    """
    read = np.full(wrench.shape, np.nan)
    weight = gravity_loads(robot, q).wrench
    for s, sensor in enumerate(robot.description.sensors):
        has = np.array([axis in sensor.axes for axis in AXES])
        value = np.where(has, wrench[:, s], 0.0)
        if sensor.frame != "sensor":
            value = _turned(robot, placed, s, value)
        value = (1.0 if sensor.polarity == "outboard" else -1.0) * value - np.array(sensor.bias)
        if sensor.compensated == "gravity":
            value = value + weight[:, s]
        read[:, s] = np.where(has, value, np.nan)
    return read


def _turned(robot: Robot, placed: Posture, sensor: int, wrench: Array) -> Array:
    """From the axes of the log to those of the sensor; the moment stays about its origin."""
    description = robot.description.sensors[sensor]
    own = next(i for i, node in enumerate(robot.nodes) if node.sensor == description.name)
    R_world_log = np.eye(3)
    if description.frame != "world":
        place = robot.places[description.frame]
        R_world_log = placed.rotation[place.node] @ place.T_node_link[:3, :3]
    R = np.swapaxes(placed.rotation[own], -1, -2) @ R_world_log
    parts = [(R @ wrench[:, part, None])[..., 0] for part in (slice(0, 3), slice(3, 6))]
    return np.concatenate(parts, axis=-1)
