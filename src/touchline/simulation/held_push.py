# SPDX-License-Identifier: Apache-2.0
"""One push on an arm that stands on springs: the same physics as `run`, several times faster.

While the arm is held by springs and the force does not change, nothing but MuJoCo itself has to
run. The force's lever about the centre of mass of the link keeps its direction in world, so the
touched point moves along with that centre and does not turn about it.
"""

import numpy as np

from touchline.arrays import Array
from touchline.simulation.contacts import ScriptedContact, cross
from touchline.simulation.plant import Plant
from touchline.simulation.readings import Readings
from touchline.simulation.setup import Setup
from touchline.simulation.truth import Truth


def can_hold(plant: Plant, log_rate: float) -> bool:
    """Whether `held_push` knows all that the robot logs."""
    readings = Readings.empty(plant, 0)
    compensated = (readings.gravity_torque, readings.motion_torque, readings.weight)
    simple = all(part is None for part in (*compensated, readings.R_log_sensor))
    joints = plant.robot.description.joints
    return (
        simple
        and plant.plain
        and plant.rate == log_rate
        and not plant.model.dof_armature.any()
        and all(joint.torque != "motor" for joint in joints)
    )


def held_push(
    plant: Plant, setup: Setup, q: Array, contact: ScriptedContact, seconds: float
) -> tuple[Readings, Truth]:
    """Pushes the arm that stands at `q`; one sample for each step of the physics.

    Args:
        plant: that `can_hold`.
        setup: with the springs' stiffness and damping.
        q: (n,) [rad or m].
        contact: with its point fixed on the link and its force in world.
        seconds: from the first sample to the last.
    """
    plant.reset(q, time=-1.0 / plant.rate)
    plant.evaluate()
    weight = plant.gravity_torque()
    stiffness, damping = plant.hold(q, setup.stiffness, setup.damping)
    plant.command(weight)
    rows = 2 + round(seconds * plant.rate)
    push = _Push(plant, contact, rows)
    for row in range(rows):
        push.step(row)
    return push.readings(q, weight, stiffness, damping), push.truth()


class _Push:
    """Steps the plant and keeps the states; the rest is computed for all samples at once."""

    def __init__(self, plant: Plant, contact: ScriptedContact, rows: int) -> None:
        self._plant, self._contact = plant, contact
        self._body = plant.bodies[contact.link]
        self._time = (np.arange(rows) - 1) / plant.rate
        self._strength = np.array([contact.profile.at(t) for t in self._time])
        n, k = len(plant.robot.joint_names), len(plant.robot.sensor_names)
        self._q, self._qd = np.empty((2, rows, n))
        self._wrench, self._com = np.empty((rows, 6 * k)), np.empty((rows, 3))
        T = plant.link_pose(contact.link)
        point, force, moment = contact.vectors()
        self._arm = T[:3, :3] @ point + T[:3, 3] - plant.data.xipos[self._body]
        self._full = np.concatenate([force, cross(self._arm, force) + moment])

    def step(self, row: int) -> None:
        plant, data = self._plant, self._plant.data
        before = None
        if row and self._strength[row] != self._strength[row - 1]:
            before = plant.forward_wrenches()
        data.xfrc_applied[self._body] = self._strength[row] * self._full
        self._wrench[row] = plant.forward_wrenches()
        if before is not None:
            self._wrench[row] = (self._wrench[row] + before) / 2
        self._q[row], self._qd[row] = plant.q, plant.qd
        self._com[row] = data.xipos[self._body]
        plant.integrate()

    def readings(self, q: Array, weight: Array, stiffness: Array, damping: Array) -> Readings:
        """All but the first state, which only leads in."""
        torque = weight + stiffness * (q - self._q) - damping * self._qd
        wrench = self._wrench.reshape(len(self._time), -1, 6)
        time, q_all, qd_all = self._time[1:], self._q[1:], self._qd[1:]
        return Readings(time, q_all, qd_all, torque[1:], torque[1:], wrench[1:])

    def truth(self) -> Truth:
        """One slot; see `Truth`."""
        links = tuple(self._plant.bodies)
        _, force, moment = self._contact.vectors()
        held = np.stack([self._strength[:-1], self._strength[1:]])  # before and after a sample
        share = held.mean(axis=0)
        point = self._com + self._arm
        levers = (point[:-1] + point[1:]) / 2  # mean over each step
        mean = np.empty((len(share), 6))
        mean[:, :3] = held[0][:, None] * force
        mean[:, 3:] = np.cross(levers, mean[:, :3]) + held[0][:, None] * moment
        index = links.index(self._contact.link)
        return Truth(
            links,
            np.where(share > 0, index, -1)[:, None],
            np.where(share[:, None] > 0, point[1:], np.nan)[:, None],
            (share[:, None] * force)[:, None],
            (share[:, None] * moment)[:, None],
            mean[:, None],
            np.where(held[0] > 0, index, -1)[:, None],
        )
