# SPDX-License-Identifier: Apache-2.0
"""The same robot in Pinocchio, with every sensor as a free joint: an independent oracle."""

import numpy as np
import pinocchio as pin

from touchline.model.transforms import pose_rpy


class PinocchioTwin:
    """Momentum, n-bar and accelerations from Pinocchio's own algorithms.

    Rows are in our order: the observed joints, then six per sensor.
    """

    def __init__(self, description, mechanism):
        self.description = description
        self.mechanism = mechanism
        self.model = pin.Model()
        self.model.gravity = pin.Motion(np.asarray(mechanism.gravity, float), np.zeros(3))
        self.ids = {}
        self._children = {}
        for joint in mechanism.joints.values():
            self._children.setdefault(joint.parent, []).append(joint)
        self._add_link(mechanism.root, 0, pin.SE3.Identity())
        self.data = self.model.createData()

    def _add_link(self, name, parent, placement):
        for sensor in self.description.sensors:
            if sensor.link == name:
                T = pin.SE3(pose_rpy(sensor.xyz, sensor.rpy))
                parent = self.model.addJoint(
                    parent, pin.JointModelFreeFlyer(), placement * T, sensor.name
                )
                self.ids[sensor.name] = parent
                placement = T.inverse()
        body = self.mechanism.links[name].inertia
        self.model.appendBodyToJoint(
            parent, pin.Inertia(body.mass, body.com, body.inertia), placement
        )
        for joint in self._children.get(name, []):
            self._add_joint(joint, parent, placement * pin.SE3(joint.T_parent_joint))

    def _add_joint(self, joint, parent, placement):
        if joint.kind == "fixed":
            self._add_link(joint.child, parent, placement)
            return
        kind = {
            "revolute": pin.JointModelRevoluteUnaligned,
            "prismatic": pin.JointModelPrismaticUnaligned,
        }[joint.kind]
        index = self.model.addJoint(parent, kind(joint.axis), placement, joint.name)
        self.ids[joint.name] = index
        self._add_link(joint.child, index, pin.SE3.Identity())

    def _names(self):
        names = [joint.name for joint in self.description.joints]
        return names + [sensor.name for sensor in self.description.sensors]

    def rows(self):
        """Indices into Pinocchio's velocity vector, in our order of rows."""
        out = []
        for name in self._names():
            joint = self.model.joints[self.ids[name]]
            out.extend(range(joint.idx_v, joint.idx_v + joint.nv))
        return np.array(out)

    def state(self, q, qd):
        """Pinocchio's configuration and velocity, with the virtual joints locked."""
        position = pin.neutral(self.model)
        velocity = np.zeros(self.model.nv)
        for i, joint in enumerate(self.description.joints):
            where = self.model.joints[self.ids[joint.name]]
            position[where.idx_q] = q[i]
            velocity[where.idx_v] = qd[i]
        return position, velocity

    def terms(self, q, qd):
        """Momentum and n-bar = g - C^T qd in our order of rows."""
        position, velocity = self.state(q, qd)
        M = self.mass_matrix(position)
        C = pin.computeCoriolisMatrix(self.model, self.data, position, velocity).copy()
        g = pin.computeGeneralizedGravity(self.model, self.data, position).copy()
        rows = self.rows()
        return (M @ velocity)[rows], (g - C.T @ velocity)[rows]

    def mass_matrix(self, position):
        M = np.triu(pin.crba(self.model, self.data, position))
        return M + np.triu(M, 1).T

    def loads(self, q, qd, qdd):
        """Torques and sensor wrenches, in our order of rows, by inverse dynamics."""
        position, velocity = self.state(q, qd)
        acceleration = np.zeros(self.model.nv)
        for i, joint in enumerate(self.description.joints):
            acceleration[self.model.joints[self.ids[joint.name]].idx_v] = qdd[i]
        return pin.rnea(self.model, self.data, position, velocity, acceleration)[self.rows()]

    def jacobian_world(self, q, link_body, point_world):
        """Rows (ours) by which a world force (3,) at a point of a body loads each coordinate."""
        position, _ = self.state(q, np.zeros(len(self.description.joints)))
        J = pin.computeJointJacobians(self.model, self.data, position)
        pin.updateGlobalPlacements(self.model, self.data)
        index = self.ids[link_body]
        J = pin.getJointJacobian(self.model, self.data, index, pin.ReferenceFrame.WORLD)
        x, y, z = point_world
        K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        return (J[:3] - K @ J[3:])[:, self.rows()]
