# SPDX-License-Identifier: Apache-2.0
# pyright: reportAttributeAccessIssue=false
"""The same observers written with Pinocchio's Python bindings, as a user would write them.

The extended one keeps each sensor as a free joint, so that mass matrix, Coriolis matrix and
gravity of all rows come from three calls. Needs `pip install pin`.
"""

import numpy as np
import pinocchio as pin

from touchline.arrays import Array
from touchline.bench.urdf import robot_urdf, sensor_joint
from touchline.model.robot import Robot


class PinocchioObserver:
    """The extended momentum observer (eqs. 11-18) over Pinocchio, as the paper prints it.

    Args:
        robot: the robot; its joints' and sensors' signals are taken as they are.
        bandwidth: K [rad/s] of all rows; Tustin's rule throughout.
        sensors: False leaves the sensors out: the classical joint observer (eq. 3).
    """

    def __init__(self, robot: Robot, bandwidth: float, sensors: bool = True) -> None:
        self.model, ids = build_model(robot, sensors)
        self.data = self.model.createData()
        self.bandwidth = bandwidth
        self.q, self.v = pin.neutral(self.model), np.zeros(self.model.nv)
        self.tau = np.zeros(self.model.nv)
        joints = [self.model.joints[ids[name]] for name in robot.joint_names]
        self.joint_q = np.array([joint.idx_q for joint in joints])
        self.joint_v = np.array([joint.idx_v for joint in joints])
        self.sensor_ids = [ids[name] for name in robot.sensor_names] if sensors else []
        starts = [self.model.joints[i].idx_v for i in self.sensor_ids]
        self.sensor_rows = [slice(start, start + 6) for start in starts]
        self.sensor_v = np.array([r for start in starts for r in range(start, start + 6)])
        self.successors = _successors(self.model, self.sensor_ids)
        self.reset()

    def reset(self) -> None:
        """Forgets the past."""
        self.r = np.zeros(self.model.nv)
        self.p: Array | None = None
        self.u = np.zeros(self.model.nv)
        self.time = 0.0

    def matrices(self, q: Array, qd: Array) -> tuple[Array, Array, Array]:
        """The three calls alone: mass matrix, Coriolis matrix, gravity of all rows."""
        self.q[self.joint_q] = q
        self.v[self.joint_v] = qd
        M = pin.crba(self.model, self.data, self.q)
        C = pin.computeCoriolisMatrix(self.model, self.data, self.q, self.v)
        return M, C, pin.computeGeneralizedGravity(self.model, self.data, self.q)

    def update(
        self, time: float, q: Array, qd: Array, tau: Array, wrench: Array
    ) -> tuple[Array, list[Array]]:
        """One sample: residual of all rows, and the wrench on each segment in world (18)."""
        M, C, g = self.matrices(q, qd)
        self.tau[self.joint_v] = tau
        if self.sensor_ids:
            self.tau[self.sensor_v] = wrench.ravel()
        p = M @ self.v
        u = self.tau + C.T @ self.v - g
        if self.p is not None:
            dt = time - self.time
            x = 0.5 * self.bandwidth * dt
            a = (1.0 - x) / (1.0 + x)
            self.r = a * self.r + (1.0 - a) * ((p - self.p) / dt - 0.5 * (u + self.u))
        self.p, self.u, self.time = p, u, time
        return self.r, self.segments()

    def segments(self) -> list[Array]:
        """Each sensor's residual in world, less those of the next sensors outboard."""
        world = [
            self.data.oMi[joint].act(pin.Force(self.r[rows])).vector
            for joint, rows in zip(self.sensor_ids, self.sensor_rows, strict=True)
        ]
        wrenches = []
        for own, outboard in zip(world, self.successors, strict=True):
            for sensor in outboard:
                own = own - world[sensor]
            wrenches.append(own)
        return wrenches

    def run(self, *signals: Array) -> tuple[Array, Array, Array]:
        """A recording: joint residuals (N, n), sensor residuals (N, k, 6), segments (N, k, 6)."""
        self.reset()
        results = [self.update(*sample) for sample in zip(*signals, strict=True)]
        r = np.array([residual for residual, _ in results])
        sensors = np.stack([r[:, rows] for rows in self.sensor_rows], axis=1)
        return r[:, self.joint_v], sensors, np.array([segments for _, segments in results])


def build_model(robot: Robot, sensors: bool = True) -> tuple[pin.Model, dict[str, int]]:
    """Pinocchio's model of a robot's URDF, and its indices of our joints and sensors by name.

    Args:
        robot: the robot.
        sensors: keep each sensor as a free joint; False lumps what it carries.
    """
    model = pin.buildModelFromXML(robot_urdf(robot, free_sensors=sensors))
    model.gravity = pin.Motion(robot.gravity, np.zeros(3))
    ids = {name: model.getJointId(name) for name in robot.joint_names}
    if sensors:
        ids |= {name: model.getJointId(sensor_joint(name)) for name in robot.sensor_names}
    return model, ids


def _successors(model: pin.Model, sensor_ids: list[int]) -> list[list[int]]:
    """Per sensor: the next ones outboard."""
    after: list[list[int]] = [[] for _ in sensor_ids]
    for i, joint in enumerate(sensor_ids):
        inboard = model.parents[joint]
        while inboard > 0 and inboard not in sensor_ids:
            inboard = model.parents[inboard]
        if inboard > 0:
            after[sensor_ids.index(inboard)].append(i)
    return after
