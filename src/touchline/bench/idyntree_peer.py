# SPDX-License-Identifier: Apache-2.0
# pyright: reportMissingImports=false
"""iDynTree's wrench estimator on the same robot. Needs `pip install idyntree`.

It separates the wrenches of the parts between its F/T sensors as the extended observer does, but
needs the joints' accelerations and the links in contact, and does not filter.
"""

import tempfile
import warnings
from collections.abc import Mapping
from pathlib import Path

from touchline.arrays import Array
from touchline.bench.urdf import node_link, robot_urdf
from touchline.errors import InputError
from touchline.model.robot import Robot

with warnings.catch_warnings():  # its types lack a __module__; as an error that ends Python
    warnings.simplefilter("ignore")
    import idyntree.swig as idyntree


class IdyntreeEstimator:
    """`ExtWrenchesAndJointTorquesEstimator` with one unknown wrench per part.

    Args:
        robot: the robot; each of its sensors begins a part.
        contacts: by sensor, the link in contact on its part; default: the first of the part.

    Raises:
        InputError: a link in contact is on another part.
        RuntimeError: if iDynTree refuses the model.
    """

    def __init__(self, robot: Robot, contacts: Mapping[str, str] | None = None) -> None:
        self.estimator = idyntree.ExtWrenchesAndJointTorquesEstimator()
        names = idyntree.StringVector()
        for name in robot.joint_names:
            names.push_back(name)
        with tempfile.TemporaryDirectory() as folder:  # it reads files only
            path = Path(folder) / "robot.urdf"
            path.write_text(robot_urdf(robot), encoding="utf-8")
            load = self.estimator.loadModelAndSensorsFromFileWithSpecifiedDOFs
            if not load(str(path), names):
                raise RuntimeError("iDynTree refuses the model")
        model, sensors = self.estimator.model(), self.estimator.sensors()
        self.nodes = [_contact_node(robot, s, contacts or {}) for s in robot.sensor_names]
        self.links = [node_link(robot, node) for node in self.nodes]
        self.unknowns = idyntree.LinkUnknownWrenchContacts(model)
        for link in ("world", *self.links):
            contact = idyntree.UnknownWrenchContact()
            contact.unknownType = idyntree.FULL_WRENCH
            contact.contactPoint.zero()
            index = model.getFrameIndex(link)
            self.unknowns.addNewContactInFrame(model, index, contact)
        self.base = model.getFrameIndex("world")
        self.link_index = [model.getLinkIndex(link) for link in self.links]
        ft = idyntree.SIX_AXIS_FORCE_TORQUE
        self.sensor_index = [sensors.getSensorIndex(ft, name) for name in robot.sensor_names]
        if min(self.sensor_index + self.link_index) < 0:
            raise RuntimeError("iDynTree does not find the robot's sensors in the model")
        self.readings = idyntree.SensorsMeasurements(sensors)
        self.wrenches = idyntree.LinkContactWrenches(model)
        self.torques = idyntree.JointDOFsDoubleArray(model)
        self.gravity = idyntree.Vector3.FromPython(robot.gravity)

    def convert(self, q: Array, qd: Array, qdd: Array, wrench: Array) -> tuple:
        """One sample in iDynTree's own types."""
        return (
            idyntree.JointPosDoubleArray.FromPython(q),
            idyntree.JointDOFsDoubleArray.FromPython(qd),
            idyntree.JointDOFsDoubleArray.FromPython(qdd),
            [_wrench(row) for row in wrench],
        )

    def estimate(self, q: object, qd: object, qdd: object, wrenches: list) -> None:
        """The estimation alone, on converted input; results stay in iDynTree's types."""
        self.estimator.updateKinematicsFromFixedBase(q, qd, qdd, self.base, self.gravity)
        for index, wrench in zip(self.sensor_index, wrenches, strict=True):
            self.readings.setMeasurement(idyntree.SIX_AXIS_FORCE_TORQUE, index, wrench)
        self.estimator.estimateExtWrenchesAndJointTorques(
            self.unknowns, self.readings, self.wrenches, self.torques
        )

    def update(self, q: Array, qd: Array, qdd: Array, wrench: Array) -> list[Array]:
        """One sample, numpy in and out: the wrench on each part, in the frame of its node.

        Those are `nodes`: the one that carries the link in contact, or the sensor's own.
        """
        self.estimate(*self.convert(q, qd, qdd, wrench))
        contact = self.wrenches.contactWrench
        return [contact(link, 0).contactWrench.toNumPy() for link in self.link_index]


def _contact_node(robot: Robot, sensor: str, contacts: Mapping[str, str]) -> int:
    if sensor not in contacts:
        return next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor)
    body = robot.body_of(contacts[sensor])
    if body.segment != sensor:
        raise InputError(f"link {contacts[sensor]} is on part {body.segment}, not on {sensor}")
    return body.node


def _wrench(values: Array) -> object:
    wrench = idyntree.Wrench()
    for i in range(6):
        wrench.setVal(i, float(values[i]))
    return wrench
