# SPDX-License-Identifier: Apache-2.0
"""Recordings as filtered equations: the residual of every row, linear in what may be wrong.

    residual = model @ inertias + rotor * I_r + speed * viscous + dry * coulomb + bias - reading

Every column has gone through the observer's own filter, so no acceleration is needed anywhere.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index, Mask
from touchline.errors import InputError
from touchline.identify.laws import SPEEDS, spread
from touchline.identify.regressor import Rows, body_vector, momentum_regressors, rows_of
from touchline.identify.smoothing import Steps, derivative, make_steps, mean, settled, smooth
from touchline.localizer.localizer import MODEL_ERROR
from touchline.model.description import Friction
from touchline.model.robot import Robot
from touchline.observer.dynamics import gravity_loads, posture
from touchline.observer.readings import read_torque, read_wrench
from touchline.observer.samples import Samples

BANDWIDTH = 20.0  # rad/s; faster says more of noise and delays than of the model
PER_CONSTANT = 2.5  # equations that are kept in each time constant of the filter
WIDTHS = (0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8)  # rad/s, of the Coulomb friction's tanh
PIECE = 512  # samples worked on at once: 40 MB with 11 bodies and 25 rows
MOST = 8000  # equations in time that are kept; longer recordings are thinned
LEAST = 10  # samples of a recording
EDGE = 1e-4  # rad; residuals change linearly with so small a lean of the base
# Masses and inertias err by `MODEL_ERROR`, 1 sigma, centres by the same part of a link's width.
LINK_WIDTH = 0.1  # m
PRESENT = 0.5  # of the samples a row must have, or it counts as not measured


@dataclass(frozen=True)
class Evidence:
    """Filtered equations of N instants, R rows, n joints and B nodes.

    Attributes:
        robot: whose rows they are.
        rows: their names and nodes.
        used: (R,) is there a reading of the row?
        bandwidth: of the filter [rad/s].
        time: (N,) [s].
        recording: (N,) its number.
        q, qd: (N, n) at these instants.
        reading: (N, R) with sign, gain and frame applied, without bias or friction; 0 if not used.
        model: (N, R, B, 10) per unit of the bodies' parameters.
        rotor: (N, n) acceleration of the joint.
        speed: (N, n) velocity.
        dry: (N, n, W) tanh of velocity over each of `WIDTHS`, then over the described width.
        laws: (N, n, K) as of `spread`: from them any law of dry friction is made.
    """

    robot: Robot
    rows: Rows
    used: Mask
    bandwidth: float
    time: Array
    recording: Index
    q: Array
    qd: Array
    reading: Array
    model: Array
    rotor: Array
    speed: Array
    dry: Array
    laws: Array

    def __len__(self) -> int:
        return len(self.time)

    def part(self, use: NDArray) -> "Evidence":
        """Some of the instants."""
        fields = ("time", "recording", "q", "qd", "reading", "model")
        fields += ("rotor", "speed", "dry", "laws")
        return replace(self, **{name: getattr(self, name)[use] for name in fields})

    def joined(self, other: "Evidence") -> "Evidence":
        """These instants and those of further recordings; rows count that all of them have."""
        fields = ("time", "q", "qd", "reading", "model", "rotor", "speed", "dry", "laws")
        both = {n: np.concatenate([getattr(self, n), getattr(other, n)]) for n in fields}
        number = other.recording + 1 + self.recording.max(initial=-1)
        both["recording"] = np.concatenate([self.recording, number])
        return replace(self, used=self.used & other.used, **both)

    @property
    def joints(self) -> int:
        """How many of the rows are joints; they come first."""
        return len(self.robot.joint_names)

    def residual(self, robot: Robot | None = None) -> Array:
        """The residual (N, R) [N or Nm] with the parameters that a robot's description has.

        Args:
            robot: of the same structure; default: the evidence's own. Sign, gain, polarity and
                frames are taken as here.
        """
        robot = robot or self.robot
        left = self._load(robot) - self.reading
        for j, joint in enumerate(robot.description.joints):
            law = joint.friction
            left[:, j] += joint.bias + joint.rotor_inertia * self.rotor[:, j]
            left[:, j] += law.viscous * self.speed[:, j]
            if law.coulomb:
                left[:, j] += law.coulomb * self.coulomb(j, law.coulomb_width)
            if law.stribeck:
                falling = self.falling(j, law.coulomb_width, law.stribeck_speed)
                left[:, j] += law.stribeck * falling
            own = self.robot.description.joints[j]
            left[:, j] -= (joint.gain / own.gain - 1.0) * self.reading[:, j]
        for s, sensor in enumerate(robot.description.sensors):
            first = self.joints + 6 * s
            left[:, first : first + 6] += sensor.bias
        return np.where(self.used, left, 0.0)

    @cached_property
    def load(self) -> Array:
        """What the described inertias make of each row (N, R) [N or Nm]."""
        return self._load(self.robot)

    def _load(self, robot: Robot) -> Array:
        bodies = np.array([body_vector(node.inertia) for node in robot.nodes])
        return np.einsum("nrbk,bk->nr", self.model, bodies)

    @cached_property
    def usual_links(self) -> Array:
        """What links are off by in any model: (N, R, c) [N or Nm], by 1 sigma of mass or centre."""
        columns = []
        for i, node in enumerate(self.robot.nodes):
            body = node.inertia
            if body.mass > 0.0:
                columns.append(MODEL_ERROR * self.model[:, :, i] @ body_vector(body))
                shifts = self.model[:, :, i, 1:4] * (MODEL_ERROR * LINK_WIDTH * body.mass)
                columns += list(np.moveaxis(shifts, -1, 0))
        return np.stack(columns, axis=-1) if columns else np.zeros((*self.reading.shape, 0))

    @cached_property
    def leaning(self) -> Array:
        """What a base that leans about each of `level_axes` adds (N, R, 2) [N or Nm per rad]."""
        robot = self.robot
        ways = [np.cross(axis, robot.gravity) for axis in level_axes(robot)]
        return np.stack([turned(self, robot, way) for way in ways], axis=-1)

    def coulomb(self, joint: int, width: float) -> Array:
        """The column (N,) of Coulomb friction of a width [rad/s]."""
        own = self.robot.description.joints[joint].friction.coulomb_width
        for i, known in enumerate((*WIDTHS, own)):
            if abs(width - known) < 1e-9:
                return self.dry[:, joint, i]
        return self.laws[:, joint] @ np.tanh(SPEEDS / width)

    def falling(self, joint: int, width: float, speed: float) -> Array:
        """The column (N,) of what falls from there with a speed [rad/s]."""
        law = Friction(coulomb_width=width, stribeck=1.0, stribeck_speed=speed)
        return self.laws[:, joint] @ law.dry(SPEEDS)


def level_axes(robot: Robot) -> Array:
    """(2, 3) world axes that are level, about which a base may lean."""
    return np.linalg.svd(robot.gravity[None])[2][1:]


def turned(evidence: Evidence, robot: Robot, change: Array) -> Array:
    """(N, R) what a small change (3,) of gravity, per unit, adds to the residual [N or Nm].

    Args:
        evidence: the instants.
        robot: with the weights that gravity acts on.
        change: of gravity in world axes [m/s2] per unit.
    """
    now, then = robot.gravity, robot.gravity + EDGE * change
    return (held_weights(evidence, robot, then) - held_weights(evidence, robot, now)) / EDGE


def held_weights(evidence: Evidence, robot: Robot, gravity: Array) -> Array:
    """(N, R) what holds the robot at rest, as far as the readings show it."""
    moved = Robot(robot.description, replace(robot.mechanism, gravity=gravity))
    found = gravity_loads(moved, evidence.q)
    loads = np.concatenate([found.torque, found.wrench.reshape(len(evidence), -1)], axis=1)
    shown = evidence.used & ~evidence.rows.silent & ~evidence.rows.weightless
    return np.where(shown, loads, 0.0)


def gather(
    robot: Robot, recordings: Iterable[Iterable[Samples]], bandwidth: float = BANDWIDTH
) -> Evidence:
    """Filters recordings of contact-free motion.

    Raises:
        InputError: none of them has samples of which anything could be made.
    """
    found: Evidence | None = None
    for recording in recordings:
        signals = _signals_of(robot, list(recording), bandwidth)
        if signals is not None:
            one = _gather_one(robot, signals, bandwidth)
            found = one if found is None else found.joined(one)
    if found is None:
        raise InputError(
            "a second of samples is needed in which positions, velocities and readings have values"
        )
    every = -(-len(found) // MOST)
    return found.part(np.arange(0, len(found), every))


def filtered(
    robot: Robot,
    recordings: Iterable[Iterable[Samples]],
    of: Callable[[Array, Array], Array],
    bandwidth: float = BANDWIDTH,
) -> NDArray[np.float32]:
    """Functions of the motion through the same filter, at the instants that `gather` keeps.

    Args:
        robot: as for `gather`.
        recordings: the same.
        of: from positions and velocities (N, n) to values (N, columns).
        bandwidth: of the filter [rad/s].

    Returns:
        (instants, columns) in single precision, which is as much as they are good for.
    """
    found: list[NDArray[np.float32]] = []
    for recording in recordings:
        signals = _signals_of(robot, list(recording), bandwidth)
        if signals is None:
            continue
        smoother = Smoother()
        for start in range(0, len(signals.q) - 1, PIECE):
            stop = min(start + PIECE, len(signals.q) - 1)
            piece = slice(start, stop + 1)
            inputs = mean(of(signals.q[piece], signals.qd[piece]))
            out = smoother.run(inputs, signals.steps.part(start, stop))
            found.append(out[signals.keep[start:stop]].astype(np.float32))
    whole = np.concatenate(found)
    return whole[:: -(-len(whole) // MOST)]


@dataclass(frozen=True)
class _Signals:
    """What is there of a recording, at N samples, and which of its intervals are kept."""

    time: Array
    q: Array
    qd: Array
    reading: Array
    used: Mask
    steps: Steps
    keep: Mask


def _signals_of(robot: Robot, parts: list[Samples], bandwidth: float) -> _Signals | None:
    if not parts:
        return None
    names = ("time", "q", "qd", "tau", "wrench")
    time, q, qd, tau, wrench = (np.concatenate([getattr(p, n) for p in parts]) for n in names)
    forward = _forward(time)
    time, q, qd, tau, wrench = (x[forward] for x in (time, q, qd, tau, wrench))
    if len(time) < LEAST:
        return None
    bare = bare_robot(robot)
    usual = np.all(np.isfinite(np.concatenate([q, qd], axis=1)), axis=1)
    q, qd = (np.where(usual[:, None], x, 0.0) for x in (q, qd))
    reading = _read(bare, q, qd, tau, wrench)
    used = np.isfinite(reading).mean(axis=0) > PRESENT
    there = np.logical_and(usual, np.isfinite(reading[:, used]).all(axis=1))
    if there.sum() < LEAST:
        return None
    # What is missing lengthens the interval, which is bridged as long as it stays short.
    time, q, qd, reading = (x[there] for x in (time, q, qd, reading))
    present = np.ones(len(time), dtype=bool)
    steps = make_steps(time, bandwidth, present)
    ready = settled(steps, bandwidth)
    period = float(np.median(steps.dt))
    every = max(1, round(1.0 / (PER_CONSTANT * bandwidth * period)))
    every = max(every, -(-len(time) // (4 * MOST)))
    keep = np.arange(len(steps.dt)) % every == 0
    keep &= ready
    return _Signals(time, q, qd, reading, used, steps, keep) if keep.any() else None


def _gather_one(robot: Robot, s: _Signals, bandwidth: float) -> Evidence:
    bare = bare_robot(robot)
    rows = rows_of(bare)
    columns = [p for p in _columns(bare, rows, s.q, s.qd, s.reading, s.steps, s.keep)]
    joined = {name: np.concatenate([c[name] for c in columns]) for name in columns[0]}
    joined["reading"] = np.where(s.used, joined["reading"], 0.0)
    at = np.flatnonzero(s.keep) + 1
    number = np.zeros(len(at), np.int64)
    return Evidence(robot, rows, s.used, bandwidth, s.time[at], number, s.q[at], s.qd[at], **joined)


def _columns(
    robot: Robot,
    rows: Rows,
    q: Array,
    qd: Array,
    reading: Array,
    steps: Steps,
    keep: Mask,
) -> Iterator[dict[str, Array]]:
    """The filtered columns, piece by piece of the recording: filters go on across pieces."""
    own = np.array([joint.friction.coulomb_width for joint in robot.description.joints])
    count = len(q)
    filters: dict[str, Smoother] = {}
    for start in range(0, count - 1, PIECE):
        stop = min(start + PIECE, count - 1)
        piece = slice(start, stop + 1)
        inner = steps.part(start, stop)
        P, B = momentum_regressors(robot, rows, q[piece], qd[piece])
        dry = [np.tanh(qd[piece] / width) for width in (*WIDTHS, own)]
        inputs = {
            "reading": mean(np.nan_to_num(reading[piece])),
            "model": derivative(P, inner) + mean(B),
            "rotor": derivative(qd[piece], inner),
            "speed": mean(qd[piece]),
            "dry": mean(np.stack(dry, axis=-1)),
            "laws": mean(spread(qd[piece])),
        }
        chosen = keep[start:stop]
        out = {}
        for name, values in inputs.items():
            smoother = filters.setdefault(name, Smoother())
            out[name] = smoother.run(values, inner)[chosen]
        yield out


class Smoother:
    """`smooth`, going on from piece to piece."""

    def __init__(self) -> None:
        self._last: Array | None = None

    def run(self, inputs: Array, steps: Steps) -> Array:
        """The next inputs (M, ...)."""
        out = smooth(inputs, steps, self._last)
        self._last = out[-1].ravel()
        return out


def bare_robot(robot: Robot) -> Robot:
    """The robot without biases and friction: what its log reads as."""
    joints = tuple(
        replace(j, bias=0.0, friction=replace(j.friction, coulomb=0.0, viscous=0.0, stribeck=0.0))
        for j in robot.description.joints
    )
    sensors = tuple(replace(s, bias=(0.0,) * 6) for s in robot.description.sensors)
    description = replace(robot.description, joints=joints, sensors=sensors)
    return Robot(description, robot.mechanism)


def _read(robot: Robot, q: Array, qd: Array, tau: Array, wrench: Array) -> Array:
    """Readings (N, R), NaN where there is none; a weight that was taken out stays out."""
    sensors = tuple(replace(s, compensated="none") for s in robot.description.sensors)
    plain = Robot(replace(robot.description, sensors=sensors), robot.mechanism)
    torques = read_torque(plain, q, qd, tau)
    if not sensors:
        return torques
    turned = any(s.frame != "sensor" for s in sensors)
    wrenches = (
        read_wrench(plain, posture(plain, q), q, wrench) if turned else _straight(plain, wrench)
    )
    return np.concatenate([torques, wrenches.reshape(len(q), -1)], axis=1)


def _straight(robot: Robot, wrench: Array) -> Array:
    read = wrench.copy()
    for s, sensor in enumerate(robot.description.sensors):
        if sensor.polarity == "inboard":
            read[:, s] *= -1.0
    return read


def _forward(time: Array) -> Mask:
    """Stamps that are later than all before."""
    clean = np.where(np.isfinite(time), time, -np.inf)
    before = np.maximum.accumulate(np.concatenate([[-np.inf], clean[:-1]]))
    return clean > before
