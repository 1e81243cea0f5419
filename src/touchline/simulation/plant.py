# SPDX-License-Identifier: Apache-2.0
"""A robot whose physics MuJoCo computes, with what ideal sensors on it read.

One step is `evaluate` (position and velocity terms), then inputs are set, then `accelerate`,
and after it `read` and `integrate` with the fourth-order Runge-Kutta rule. Inputs are held over
the step. All readings belong to the state before the step; `read` may be asked for the same state
before and after an input has changed.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from touchline.arrays import Array
from touchline.extras import need
from touchline.model.description import Friction
from touchline.model.mechanism import Mechanism
from touchline.model.robot import Robot
from touchline.simulation.mujoco_model import Addition, build_model

HOLDING_FREQUENCY = 25.0  # rad/s of a joint on springs of its own
FASTEST_DECAY = 1.5  # of a damper, per step; Runge-Kutta's limit is 2.8, of a held torque 2


class Reading(NamedTuple):  # made twice a sample: a dataclass takes longer
    """What ideal sensors read at one instant.

    Attributes:
        link_torque: (n,) torque that passes from the drive into the link [Nm or N].
        motor_torque: (n,) torque of the motor, before rotor and friction [Nm or N]; springs and
            dampers set in the model count as the motor's.
        wrench: (k, 6) on the outboard body, sensor frame [N, Nm].
        acceleration: (n,) of the joints, which no sensor reads [rad/s2 or m/s2].
        motion_torque: (n,) that the motion would take without contact; None where no joint's
            driver takes it out [Nm or N].
    """

    link_torque: Array
    motor_torque: Array
    wrench: Array
    acceleration: Array
    motion_torque: Array | None = None


class Plant:
    """The robot in MuJoCo.

    Args:
        robot: whose sensors, locked joints and motor-side rotors and friction are simulated.
        rate: of the physics [Hz].
        mechanism: with other inertias than the description has; default: the robot's own.
        armature: reflected rotor inertia by joint [kg m2]; default: that of the joints whose
            torque is measured on the motor side.
        addition: see `build_model`.
    """

    def __init__(
        self,
        robot: Robot,
        rate: float = 4000.0,
        mechanism: Mechanism | None = None,
        armature: Mapping[str, float] | None = None,
        addition: Addition | None = None,
    ) -> None:
        self._mj: Any = need("mujoco")  # its stubs lack most names
        self.robot, self.rate = robot, rate
        joints = robot.description.joints
        motors = {j.name: j.rotor_inertia for j in joints if j.torque == "motor"}
        built = build_model(robot, 1.0 / rate, mechanism, {**motors, **(armature or {})}, addition)
        self.model, self.bodies = built.model, built.bodies
        self.data = self._mj.MjData(self.model)
        self._dofs = np.array([built.joints[j.name] for j in joints], dtype=int)
        self._set_couplings(built.joints)
        self._moved_bodies = self.model.dof_bodyid[self._robot_dofs]
        self._no_torque = np.zeros(len(joints))
        self._no_torque.setflags(write=False)
        self._from_inputs = int(self._mj.mjtStage.mjSTAGE_VEL)
        self._site_ids = [self.model.site(f"sensor:{s}").id for s in robot.sensor_names]
        self._shows_motion = any(j.compensated == "model" for j in joints)
        moved = any(j.torque == "motor" for j in joints)
        self._friction = _Friction(robot) if moved else None
        self._motor_torque = np.zeros(len(joints))
        self._told = self._motor_torque.tolist()  # the same; lists of few numbers compare faster
        self._own_mass: dict[int, float] = {}

    def _set_couplings(self, joints: Mapping[str, int]) -> None:
        """Positions are P q + offset for the robot's coordinates, mimicking joints included."""
        self._robot_dofs = np.array(list(joints.values()), dtype=int)
        n = len(self._dofs)
        self._P = np.zeros((len(self._robot_dofs), n))
        self._offset = np.zeros(len(self._robot_dofs))
        index = {name: i for i, name in enumerate(self.robot.joint_names)}
        for row, name in enumerate(joints):
            mimic = self.robot.mechanism.joints[name].mimic
            self._P[row, index[mimic.joint if mimic else name]] = mimic.multiplier if mimic else 1.0
            self._offset[row] = mimic.offset if mimic else 0.0
        in_order = np.array_equal(self._dofs, np.arange(self.model.nv))
        self.plain = in_order and np.array_equal(self._P, np.eye(n))

    @property
    def time(self) -> float:
        """Time of the state [s]."""
        return self.data.time

    @property
    def q(self) -> Array:
        """Joint positions (n,) [rad or m], a copy."""
        return self.data.qpos[self._dofs]

    @property
    def qd(self) -> Array:
        """Joint velocities (n,) [rad/s or m/s], a copy."""
        return self.data.qvel[self._dofs]

    def reset(self, q: Array, qd: Array | None = None, time: float = 0.0) -> None:
        """Puts the robot at `q` (n,), moving at `qd` (n,), at a time [s]."""
        self._mj.mj_resetData(self.model, self.data)
        self.data.time = time
        self.data.qpos[self._robot_dofs] = self._P @ q + self._offset
        if qd is not None:
            self.data.qvel[self._robot_dofs] = self._P @ qd
        self._motor_torque[:] = 0.0
        self._told = self._motor_torque.tolist()

    def evaluate(self) -> None:
        """Computes what depends on positions and velocities alone."""
        self._mj.mj_fwdPosition(self.model, self.data)
        self._mj.mj_fwdVelocity(self.model, self.data)

    def command(self, torque: Array) -> bool:
        """Sets the motors' torques (n,) [Nm or N]; motor-side friction is taken off here.

        Returns:
            Whether anything has changed.
        """
        told = torque.tolist()
        if self._friction is None and told == self._told:
            return False
        self._motor_torque[:], self._told = torque, told
        applied = torque if self._friction is None else torque - self.friction_torque()
        self.data.qfrc_applied[self._dofs] = applied
        return True

    def hold(
        self, q: Array, stiffness: Array | None = None, damping: Array | None = None
    ) -> tuple[Array, Array]:
        """Puts springs about `q` (n,) and dampers into the joints, as part of the physics.

        Args:
            q: pose at which the springs are slack [rad or m].
            stiffness: (n,) [Nm/rad]; None: HOLDING_FREQUENCY for the inertia that each joint
                moves at the plant's present state, which has been evaluated.
            damping: (n,) [Nm s/rad]; None: critical for the same inertia.

        Returns:
            Stiffness and damping (n,) as set: both less where the physics' step is too long for
            the dampers at the present inertia.
        """
        inertia = self.inertia()
        if stiffness is None or damping is None:
            stiffness = np.diag(inertia) * HOLDING_FREQUENCY**2
            damping = 2 * np.diag(inertia) * HOLDING_FREQUENCY
        softer = steady_share(inertia, damping, self.rate)
        stiffness, damping = softer * stiffness, softer * damping
        m = self.model
        m.jnt_stiffness[m.dof_jntid[self._dofs]], m.dof_damping[self._dofs] = stiffness, damping
        m.qpos_spring[self._dofs] = q
        return stiffness, damping

    def load(self, link: str, mass: float) -> None:
        """Lets a link carry a point mass [kg] at its centre of mass, besides its own mass."""
        body = self.bodies[link]
        own = self._own_mass.setdefault(body, float(self.model.body_mass[body]))
        self.model.body_mass[body] = own + mass
        self._mj.mj_setConst(self.model, self._mj.MjData(self.model))

    def accelerate(self) -> None:
        """Computes accelerations and contact forces for the inputs that are set."""
        self._mj.mj_forwardSkip(self.model, self.data, self._from_inputs, 1)

    def integrate(self) -> None:
        """Moves on by one step; to be called after `accelerate`."""
        self._mj.mj_RungeKutta(self.model, self.data, 4)

    def forward_wrenches(self) -> Array:
        """Evaluates, accelerates, and returns the sensors' wrenches (6 k,) as in `Reading`."""
        self._mj.mj_forward(self.model, self.data)
        return self.data.sensordata[: 6 * len(self._site_ids)].copy()

    def read(self) -> Reading:
        """What ideal sensors read; to be called after `accelerate`."""
        m, d = self.model, self.data
        self._mj.mj_rnePostConstraint(m, d)
        self._mj.mj_sensorAcc(m, d)
        # Both are about the same point, so the product is the power of the transmitted wrench.
        wrenches = d.cfrc_int.take(self._moved_bodies, 0)
        transmitted = np.einsum("ij,ij->i", d.cdof.take(self._robot_dofs, 0), wrenches)
        k = len(self._site_ids)
        return Reading(
            transmitted if self.plain else self._P.T @ transmitted,
            self._motor_torque + d.qfrc_passive[self._dofs],
            d.sensordata[: 6 * k].reshape(k, 6).copy(),
            d.qacc[self._dofs],
            self._motion_torque() if self._shows_motion else None,
        )

    def inertia(self) -> Array:
        """Mass matrix (n, n), rotors included [kg m2]."""
        return np.array([self.inertia_times(e) for e in np.eye(len(self._dofs))])

    def inertia_times(self, acceleration: Array) -> Array:
        """Mass matrix times `acceleration` (n,), rotors included [Nm or N]."""
        out = np.empty(self.model.nv)
        if self.plain:
            self._mj.mj_mulM(self.model, self.data, out, acceleration)
            return out
        full = np.zeros(self.model.nv)
        full[self._robot_dofs] = self._P @ acceleration
        self._mj.mj_mulM(self.model, self.data, out, full)
        return self._P.T @ out[self._robot_dofs]

    def bias_torque(self) -> Array:
        """Torques (n,) of gravity, Coriolis and centrifugal forces at the state [Nm or N]."""
        if self.plain:
            return self.data.qfrc_bias.copy()
        return self._P.T @ self.data.qfrc_bias[self._robot_dofs]

    def friction_torque(self) -> Array:
        """Torque (n,) that the drives' friction takes from the motors at the state [Nm or N]."""
        if self._friction is None:
            return self._no_torque
        return self._friction.of_drives(self.qd)

    def gravity_torque(self) -> Array:
        """Torques (n,) that hold the robot against gravity at the state [Nm or N]."""
        velocity = self.data.qvel.copy()
        self.data.qvel[:] = 0.0
        out = np.empty(self.model.nv)
        self._mj.mj_fwdVelocity(self.model, self.data)
        self._mj.mj_rne(self.model, self.data, 0, out)
        self.data.qvel[:] = velocity
        self._mj.mj_fwdVelocity(self.model, self.data)
        return self._P.T @ out[self._robot_dofs]

    def _motion_torque(self) -> Array:
        out = np.empty(self.model.nv)
        self._mj.mj_rne(self.model, self.data, 1, out)
        return self._P.T @ out[self._robot_dofs]

    def link_pose(self, link: str) -> Array:
        """Pose (4, 4) of a link in world at the state."""
        body, T = self.bodies[link], np.eye(4)
        T[:3, :3] = self.data.xmat[body].reshape(3, 3)
        T[:3, 3] = self.data.xpos[body]
        return T

    def log_rotations(self) -> Array:
        """Rotations (k, 3, 3) from the sensors' axes to those in which their logs are given."""
        rotations = self.data.site_xmat[self._site_ids].reshape(-1, 3, 3)
        for s, sensor in enumerate(self.robot.description.sensors):
            if sensor.frame == "sensor":
                rotations[s] = np.eye(3)
            elif sensor.frame != "world":
                rotations[s] = self.link_pose(sensor.frame)[:3, :3].T @ rotations[s]
        return rotations

    def sensor_weights(self) -> Array:
        """Gravity's wrench (k, 6) on all that each sensor carries, sensor frame [N, Nm]."""
        weights = np.empty((len(self._site_ids), 6))
        for s, site in enumerate(self._site_ids):
            body = self.model.site_bodyid[site]
            force = self.model.body_subtreemass[body] * np.asarray(self.model.opt.gravity)
            arm = self.data.subtree_com[body] - self.data.site_xpos[site]
            R = self.data.site_xmat[site].reshape(3, 3)
            weights[s, :3], weights[s, 3:] = R.T @ force, R.T @ np.cross(arm, force)
        return weights


def steady_share(inertia: Array, damping: Array, rate: float) -> float:
    """The share, at most 1, of dampers that stays steady where time goes in steps.

    The fastest decay must be slow against a step, or each step overshoots the one before.

    Args:
        inertia: (n, n) [kg m2].
        damping: (n,) of the joints [Nm s/rad].
        rate: of the steps [Hz].
    """
    root = np.sqrt(damping)  # D^1/2 M^-1 D^1/2 has the eigenvalues of M^-1 D, and is symmetric
    fastest = np.linalg.eigvalsh(root[:, None] * np.linalg.solve(inertia, np.diag(root)))[-1]
    return min(1.0, FASTEST_DECAY * rate / max(float(fastest), 1e-9))


class _Friction:
    """Friction of the drives whose torque is measured on the motor side."""

    def __init__(self, robot: Robot) -> None:
        laws = [j.friction if j.torque == "motor" else Friction() for j in robot.description.joints]
        rows = [(law.coulomb, law.viscous, law.coulomb_width) for law in laws]
        self._coulomb, self._viscous, self._width = np.array(rows).reshape(-1, 3).T
        self._falling = [(j, law) for j, law in enumerate(laws) if law.stribeck]

    def of_drives(self, qd: Array) -> Array:
        torque = self._coulomb * np.tanh(qd / self._width) + self._viscous * qd
        for j, law in self._falling:
            torque[j] = law.dry(qd[j]) + law.viscous * qd[j]
        return torque
