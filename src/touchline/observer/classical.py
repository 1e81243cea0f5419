# SPDX-License-Identifier: Apache-2.0
"""The classical route to the wrenches at the sensors, which the extended observer is held against.

Accelerations from eq. (6) of Iskandar et al., ICRA 2021, then Newton-Euler at the sensors; its
joint residual is that of `JointMomentumObserver`. Offline and in numpy.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.observer.dynamics import (
    gravity_loads,
    inverse_dynamics,
    mass_matrix,
    posture,
    to_world,
)
from touchline.observer.joint_momentum import (
    JointEstimate,
    JointMomentumObserver,
    ToolWrench,
    blocks,
    checked_recording,
    expect_shape,
    moved_mass,
    tool_wrench,
)
from touchline.observer.readings import read_torque, read_wrench

__all__ = [
    "ClassicalEstimate",
    "ClassicalObserver",
    "JointEstimate",
    "JointMomentumObserver",
    "ToolWrench",
    "acceleration",
    "classical_error",
    "tool_wrench",
]


@dataclass(frozen=True)
class ClassicalEstimate:
    """What the classical route knows after each of N samples.

    Attributes:
        tau_ext: external joint torques (N, n) [Nm], low-passed (eq. 4).
        acceleration: joint accelerations (N, n) by eq. (6).
        sensor_wrench: external wrench (N, k, 6) [N, Nm] on everything outboard of each sensor, in
            the sensor frame; not low-passed, but coupled to `tau_ext`.
        segment_wrench: external wrench (N, m, 6) on each segment alone, world axes, about the
            world's origin; NaN for `root`.
    """

    tau_ext: Array
    acceleration: Array
    sensor_wrench: Array
    segment_wrench: Array


class ClassicalObserver:
    """Accelerations from the joint residual (eq. 6), then Newton-Euler at the sensors.

    What the paper's figure 4 calls the classical approach. Its sensor wrenches lack the lag of a
    filter, but every error of the joint residual enters them through `M^-1` (`classical_error`).

    Args:
        robot: the robot; every joint needs a torque signal from which the model is not taken out.
        bandwidth: K [rad/s] of the joint residuals; default: the description's.
        discretization: as in `JointMomentumObserver`.

    Raises:
        InputError: if a joint has no torque signal, or one that lacks the model's own torque.
        ValueError: for an unknown discretization or a bandwidth that is not positive.
    """

    def __init__(
        self, robot: Robot, bandwidth: float | None = None, discretization: str = "automatic"
    ) -> None:
        _require_torques(robot)
        self.robot = robot
        self.joints = JointMomentumObserver(robot, bandwidth, discretization)
        self._segments = _segment_signs(robot)

    def run(
        self, time: ArrayLike, q: ArrayLike, qd: ArrayLike, tau: ArrayLike, wrench: ArrayLike
    ) -> ClassicalEstimate:
        """Takes a recording of N samples, as the robot reports it.

        Args:
            time: time stamps (N,) [s], increasing.
            q: joint positions (N, n) [rad or m].
            qd: joint velocities (N, n).
            tau: logged joint torques (N, n).
            wrench: logged sensor wrenches (N, k, 6); NaN where not measured.

        Raises:
            InputError: for a wrong shape, a joint value that is not finite, or time that stands
                still.
        """
        residual = self.joints.run(time, q, qd, tau).tau_ext
        _, q, qd, tau = checked_recording(self.robot, time, q, qd, tau)
        wrench = np.asarray(wrench, dtype=float)
        expect_shape("wrench", wrench, (len(q), len(self.robot.sensor_names), 6))
        parts = [
            self._estimate(residual[rows], q[rows], qd[rows], tau[rows], wrench[rows])
            for rows in blocks(len(q))
        ]
        return ClassicalEstimate(residual, *(np.concatenate(x) for x in zip(*parts, strict=True)))

    def _estimate(
        self, residual: Array, q: Array, qd: Array, tau: Array, wrench: Array
    ) -> tuple[Array, Array, Array]:
        """Accelerations, sensor wrenches and segment wrenches of one block."""
        robot = self.robot
        placed = posture(robot, q)
        qdd = acceleration(robot, q, qd, tau, residual)
        needed = inverse_dynamics(robot, q, qd, qdd).wrench
        external = needed - read_wrench(robot, placed, q, wrench)
        nodes = [_sensor_node(robot, s) for s in range(len(robot.sensor_names))]
        world = np.zeros_like(external)
        for s, node in enumerate(nodes):
            world[:, s] = to_world(external[:, s], placed.rotation[node], placed.origin[node])
        segments = np.full((len(q), len(self._segments), 6), np.nan)
        for g, signs in enumerate(self._segments):
            if signs:
                segments[:, g] = sum(sign * world[:, s] for s, sign in signs.items())
        return qdd, external, segments


def acceleration(robot: Robot, q: Array, qd: Array, tau: Array, residual: Array) -> Array:
    """Joint accelerations (N, n) by eq. (6), from logged torques and the joint residual."""
    joints = robot.description.joints
    rest = inverse_dynamics(robot, q, qd, np.zeros_like(qd)).torque  # C qd + g
    weight = gravity_loads(robot, q).torque
    taken_out = np.array([joint.compensated == "gravity" for joint in joints])
    load = read_torque(robot, q, qd, tau) + np.where(taken_out, weight, 0.0)
    return _solved(moved_mass(robot, q), load - rest + residual)


def classical_error(robot: Robot, q: ArrayLike, residual: ArrayLike, tau_ext: ArrayLike) -> Array:
    """The classical route's exact error at the sensors, `M_vq M^-1 (r - tau_ext)`.

    Args:
        robot: the robot.
        q: joint positions (..., n) [rad or m].
        residual: the joint residual (..., n) [Nm] that it uses.
        tau_ext: the true external joint torque (..., n) [Nm].

    Returns:
        `ClassicalEstimate.sensor_wrench` minus the truth, (..., k, 6) [N, Nm].
    """
    M, M_vq = moved_mass(robot, q), mass_matrix(robot, q)[1]
    difference = np.asarray(residual, dtype=float) - np.asarray(tau_ext, dtype=float)
    return np.einsum("...sij,...j->...si", M_vq, _solved(M, difference))


def _solved(matrix: Array, vector: Array) -> Array:
    return np.asarray(np.linalg.solve(matrix, vector[..., None])[..., 0], dtype=np.float64)


def _require_torques(robot: Robot) -> None:
    """Eq. (6) needs the whole torque of every joint."""
    problems = []
    for joint in robot.description.joints:
        if not joint.measured:
            problems.append(
                f"joints.{joint.name}.torque is '{joint.torque}': the classical route needs a "
                "measured torque at every joint (sensor, motor)"
            )
        elif joint.compensated == "model":
            problems.append(
                f"joints.{joint.name}.compensated is 'model': the classical route needs the "
                "torque itself, allowed: none, gravity"
            )
    if problems:
        raise InputError(problems)


def _sensor_node(robot: Robot, sensor: int) -> int:
    name = robot.sensor_names[sensor]
    return next(i for i, node in enumerate(robot.nodes) if node.sensor == name)


def _segment_signs(robot: Robot) -> list[dict[int, int]]:
    """Per segment: +1 for the sensor that it begins at, -1 for the next ones outboard (18)."""
    six_axis = [s for s, d in enumerate(robot.description.sensors) if len(d.axes) == 6]
    segment_at = {robot.sensor_names[s]: g for g, s in enumerate(six_axis)}
    signs: list[dict[int, int]] = [{} for _ in robot.segment_names]
    for g, s in enumerate(six_axis):
        signs[g][s] = 1
        node = robot.nodes[_sensor_node(robot, s)].parent
        while node >= 0 and robot.nodes[node].sensor not in segment_at:
            node = robot.nodes[node].parent
        if node >= 0:
            signs[segment_at[str(robot.nodes[node].sensor)]][s] = -1
    return signs
