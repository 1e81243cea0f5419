# SPDX-License-Identifier: Apache-2.0
"""A prescribed motion and the exact sensor readings that belong to it, from MuJoCo.

The motion is given, so nothing is integrated: the readings are those of inverse dynamics, right to
rounding, and they come from other code than the estimators'.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.simulation.plant import Plant


@dataclass(frozen=True)
class Wave:
    """`amplitude sin(rate t + phase)` with an amplitude (n,) [rad] for each joint."""

    amplitude: Array
    rate: float
    phase: float = 0.0


@dataclass(frozen=True)
class Motion:
    """A joint motion without contact and what ideal sensors read during it.

    Attributes:
        time: (N,) [s].
        q, qd, qdd: (N, n) [rad, rad/s, rad/s2].
        torque: (N, n) that moves the links [Nm].
        wrench: (N, k, 6) on the outboard bodies, sensor frames [N, Nm].
    """

    time: Array
    q: Array
    qd: Array
    qdd: Array
    torque: Array
    wrench: Array


def prescribed_motion(
    robot: Robot, time: Array, center: Array, waves: Sequence[Wave], origin: float = 0.0
) -> Motion:
    """Waves about a centre (n,) [rad]; their time counts from `origin` [s]."""
    q = np.tile(center, (len(time), 1))
    qd, qdd = np.zeros_like(q), np.zeros_like(q)
    for wave in waves:
        angle = (wave.rate * (time - origin) + wave.phase)[:, None]
        q += wave.amplitude * np.sin(angle)
        qd += wave.amplitude * wave.rate * np.cos(angle)
        qdd -= wave.amplitude * wave.rate**2 * np.sin(angle)
    return Motion(time, q, qd, qdd, *_readings(robot, q, qd, qdd))


def coupling(robot: Robot, q: Array) -> Array:
    """`M_vq M^-1` (N, k, 6, n): the wrench at each sensor, in its frame, per Nm at each joint.

    `M_vq` by unit accelerations from rest, and `M`, both of them MuJoCo's.
    """
    plant = Plant(robot)
    n, k = len(robot.joint_names), len(robot.sensor_names)
    dofs = [int(plant.model.joint(f"joint:{name}").dofadr[0]) for name in robot.joint_names]
    loads = np.empty((n + 1, n + 6 * k))
    gain = np.empty((len(q), 6 * k, n))
    for i in range(len(q)):
        plant.reset(q[i])
        plant.evaluate()
        for j in range(n + 1):
            plant.data.qacc[:] = 0.0
            if j < n:
                plant.data.qacc[dofs[j]] = 1.0
            reading = plant.read()
            loads[j] = np.r_[reading.link_torque, reading.wrench.ravel()]
        M, M_vq = np.split((loads[:n] - loads[n]).T, [n])
        gain[i] = np.linalg.solve(M.T, M_vq.T).T
    return gain.reshape(len(q), k, 6, n)


def _readings(robot: Robot, q: Array, qd: Array, qdd: Array) -> tuple[Array, Array]:
    plant = Plant(robot)
    dofs = [int(plant.model.joint(f"joint:{name}").dofadr[0]) for name in robot.joint_names]
    torque, wrench = np.empty_like(q), np.empty((len(q), len(robot.sensor_names), 6))
    for i in range(len(q)):
        plant.reset(q[i], qd[i])
        plant.evaluate()
        plant.data.qacc[dofs] = qdd[i]
        reading = plant.read()
        torque[i], wrench[i] = reading.link_torque, reading.wrench
    return torque, wrench
