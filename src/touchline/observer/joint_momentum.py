# SPDX-License-Identifier: Apache-2.0
"""The momentum observer of the joints alone, and the tool wrench made from its residual.

The classical method, offline and in numpy. Equation numbers are those of Iskandar et al., ICRA
2021; the observer itself is De Luca's.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array, Index
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.observer.dynamics import (
    coriolis_matrix,
    gravity_loads,
    mass_matrix,
    point_jacobian,
)
from touchline.observer.observer import DISCRETIZATIONS
from touchline.observer.readings import read_torque
from touchline.tuning import DEFAULTS

TUSTIN_LIMIT = DEFAULTS["observer.tustin_steps"]  # K dt up to which `automatic` takes Tustin's rule
# As the extended observer: steps of up to so many median ones are no gap; a gap is integrated over
# up to so many time constants, but not beyond so much time [s].
GAP_PERIODS = DEFAULTS["observer.gap_periods"]
BRIDGED_STEPS = DEFAULTS["observer.bridged_steps"]
LONGEST_BRIDGE = DEFAULTS["observer.longest_bridge"]
BLOCK = 4096  # samples whose matrices are held at a time


@dataclass(frozen=True)
class JointEstimate:
    """What the joint observer knows after each of N samples.

    Attributes:
        tau_ext: external joint torques (N, n) [Nm], low-passed (eq. 4); NaN where a joint has no
            torque signal.
    """

    tau_ext: Array


@dataclass(frozen=True)
class ToolWrench:
    """The wrench at one point that would explain the joint residuals best (eq. 5).

    Attributes:
        wrench: (..., 6) [N, Nm], world axes, about the point; with a rank below 6 it is the
            smallest of all that explain the residuals equally well.
        rank: (...) number of its components that the joints can tell.
        condition: (...) largest over smallest singular value of `J_c^T` that counts for the rank;
            moments in Nm and forces in N weigh alike.
    """

    wrench: Array
    rank: Index
    condition: Array


class JointMomentumObserver:
    """The momentum observer of the joints alone (eq. 3), with the extended one's time steps.

    Args:
        robot: the robot; its sensors are not used.
        bandwidth: K [rad/s] of all joints; default: the description's.
        discretization: "tustin", "exponential", or "automatic": Tustin up to K dt = 0.5.

    Raises:
        ValueError: for an unknown discretization or a bandwidth that is not positive.
    """

    def __init__(
        self, robot: Robot, bandwidth: float | None = None, discretization: str = "automatic"
    ) -> None:
        if discretization not in DISCRETIZATIONS:
            allowed = ", ".join(DISCRETIZATIONS)
            raise ValueError(f"discretization is '{discretization}', allowed: {allowed}")
        if bandwidth is not None and not (np.isfinite(bandwidth) and bandwidth > 0):
            raise ValueError(f"bandwidth is {bandwidth}, but must be a positive number [rad/s]")
        self.robot = robot
        self.discretization = discretization
        n = len(robot.joint_names)
        own = np.array(robot.description.bandwidth_joints, dtype=float)
        self.bandwidth = own if bandwidth is None else np.full(n, float(bandwidth))

    def run(self, time: ArrayLike, q: ArrayLike, qd: ArrayLike, tau: ArrayLike) -> JointEstimate:
        """Takes a recording of N samples, as the robot reports it.

        Args:
            time: time stamps (N,) [s], increasing.
            q: joint positions (N, n) [rad or m].
            qd: joint velocities (N, n).
            tau: logged joint torques (N, n).

        Raises:
            InputError: for a wrong shape, a number that is not finite, or time that stands still.
        """
        time, q, qd, tau = checked_recording(self.robot, time, q, qd, tau)
        p, u = np.empty_like(q), np.empty_like(q)
        for rows in blocks(len(time)):
            p[rows], u[rows] = self._balance(q[rows], qd[rows], tau[rows])
        return JointEstimate(self._filter(time, p, u))

    def _balance(self, q: Array, qd: Array, tau: Array) -> tuple[Array, Array]:
        """Momentum `p` and known load `u = tau - n`, `n = g - C^T qd`, of each joint."""
        joints = self.robot.description.joints
        M = moved_mass(self.robot, q)
        C_transposed = np.swapaxes(coriolis_matrix(self.robot, q, qd), -1, -2)
        load = read_torque(self.robot, q, qd, tau)
        weight = gravity_loads(self.robot, q).torque
        p, u = times(M, qd), load + times(C_transposed, qd) - weight
        for j, joint in enumerate(joints):
            if joint.compensated == "gravity":
                u[:, j] += weight[:, j]
            elif joint.compensated == "model":  # the reading is minus the external torque
                p[:, j], u[:, j] = 0.0, load[:, j]
        return p, u

    def _filter(self, time: Array, p: Array, u: Array) -> Array:
        """Low-passes the mean external load over each interval; starts anew after a long gap."""
        r = np.zeros_like(p)
        r[0] = np.where(np.isnan(u[0]), np.nan, 0.0)  # NaN: no torque signal
        dt = np.diff(time)
        if len(dt) == 0:
            return r
        a = np.array([self._poles(step) for step in dt])
        e = np.diff(p, axis=0) / dt[:, None] - 0.5 * (u[:-1] + u[1:])
        period = np.median(dt)
        bridge = np.minimum(BRIDGED_STEPS / self.bandwidth, LONGEST_BRIDGE) + 1.5 * period
        whole = dt[:, None] <= np.maximum(GAP_PERIODS * period, bridge)
        for i in range(len(dt)):
            r[i + 1] = np.where(whole[i], a[i] * r[i] + (1.0 - a[i]) * e[i], r[0])
        return r

    def _poles(self, dt: float) -> Array:
        x = self.bandwidth * dt
        tustin = (1.0 - 0.5 * x) / (1.0 + 0.5 * x)
        if self.discretization == "automatic":
            return np.where(x <= TUSTIN_LIMIT, tustin, np.exp(-x))
        return tustin if self.discretization == "tustin" else np.exp(-x)


def tool_wrench(
    robot: Robot,
    q: ArrayLike,
    residual: ArrayLike,
    link: str,
    point: ArrayLike = (0.0, 0.0, 0.0),
    tolerance: float = 1e-9,
) -> ToolWrench:
    """The wrench at a point of a link that explains the joint residuals, `(J_c^T)^# r` (eq. 5).

    Args:
        robot: the robot.
        q: joint positions (..., n) [rad or m].
        residual: external joint torques (..., n) [Nm]; a NaN leaves that joint out.
        link: the link in contact, known beforehand.
        point: (3,) [m] where it is touched, in the link's frame.
        tolerance: singular values below this part of the largest do not count for the rank.

    Raises:
        InputError: for an unknown link.
    """
    if link not in robot.places:
        raise InputError(f"link is '{link}', allowed: {', '.join(robot.places)}")
    residual = np.asarray(residual, dtype=float)
    known = np.isfinite(residual)
    J = np.where(known[..., None, :], point_jacobian(robot, q, link, point), 0.0)
    r = np.where(known, residual, 0.0)
    U, sigma, Vt = np.linalg.svd(np.swapaxes(J, -1, -2), full_matrices=False)
    counts = sigma > tolerance * np.maximum(sigma[..., :1], np.finfo(float).tiny)
    inverse = np.divide(1.0, sigma, out=np.zeros_like(sigma), where=counts)
    along = np.einsum("...ji,...j->...i", U, r) * inverse
    smallest = np.where(counts, sigma, np.inf).min(axis=-1)
    condition = np.where(counts.any(axis=-1), sigma[..., 0] / smallest, np.nan)
    return ToolWrench(np.einsum("...ij,...i->...j", Vt, along), counts.sum(axis=-1), condition)


def moved_mass(robot: Robot, q: ArrayLike) -> Array:
    """Mass matrix (..., n, n) that the measured torques move: rotors count on the motor side."""
    rotors = [joint.rotor_inertia for joint in robot.description.joints]
    return mass_matrix(robot, q)[0] + np.diag(rotors)


def checked_recording(
    robot: Robot, time: ArrayLike, q: ArrayLike, qd: ArrayLike, tau: ArrayLike
) -> tuple[Array, Array, Array, Array]:
    """A recording as arrays of floats.

    Raises:
        InputError: for a wrong shape, a number that is not finite, or time that stands still.
    """
    time = np.asarray(time, dtype=float)
    if time.ndim != 1 or len(time) == 0:
        raise InputError(f"time has shape {time.shape}, expected (N,) with N > 0")
    late = np.flatnonzero(~(np.diff(time) > 0))
    if len(late):
        row = int(late[0]) + 1
        raise InputError(f"time, row {row}: {time[row]} after {time[row - 1]}, must increase")
    arrays = []
    for name, signal in (("q", q), ("qd", qd), ("tau", tau)):
        array = np.asarray(signal, dtype=float)
        expect_shape(name, array, (len(time), len(robot.joint_names)))
        _expect_finite(robot, name, array)
        arrays.append(array)
    return time, arrays[0], arrays[1], arrays[2]


def expect_shape(name: str, array: Array, shape: tuple[int, ...]) -> None:
    """Raises an InputError unless the array has that shape."""
    if array.shape != shape:
        raise InputError(f"{name} has shape {array.shape}, expected {shape}")


def _expect_finite(robot: Robot, name: str, array: Array) -> None:
    for j, joint in enumerate(robot.description.joints):
        if name == "tau" and not joint.measured:
            continue
        bad = np.flatnonzero(~np.isfinite(array[:, j]))
        if len(bad):
            raise InputError(
                f"{name}.{joint.name}, row {bad[0]}: {array[bad[0], j]}; the classical methods "
                "need a finite number in every row"
            )


def blocks(size: int) -> Iterator[slice]:
    """Slices of at most BLOCK rows that cover `size` rows."""
    for start in range(0, size, BLOCK):
        yield slice(start, min(start + BLOCK, size))


def times(matrix: Array, vector: Array) -> Array:
    """Matrices (..., i, j) times vectors (..., j)."""
    return (matrix @ vector[..., None])[..., 0]
