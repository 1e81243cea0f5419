# SPDX-License-Identifier: Apache-2.0
"""What the sensors say and what the model expects, averaged over short pieces of a recording.

An observer without lag that is told of no torque and no wrench takes all that moves and holds the
arm for external: its residuals are the readings to be expected while nothing touches.
"""

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from touchline.arrays import Array, Index
from touchline.model.description import Friction
from touchline.model.robot import Robot
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples

SECONDS, ROWS = 0.25, 8  # at least so long and so many samples is a window
MOST = 4000
INSTANT = 1e-3  # s; a motion goes on evenly for so long
# Dry friction turns its sign over such speeds [rad/s or m/s], and holds a slower joint, of which a
# motor's current says nothing; so many windows must be faster.
DRY_SPEED, ENOUGH = 0.02, 8
JOINT_FIELDS = (
    *("q", "qd", "slope", "acceleration"),
    *("tau", "torque", "expected_torque", "expected_rate"),
)
WRENCH_FIELDS = "wrench", "expected_wrench", "weightless_wrench", "wrench_rate", "weightless_rate"


@dataclass(frozen=True)
class Windows:
    """W windows of a recording; everything is a mean over the window.

    Attributes:
        q: (W, n) positions.
        qd: (W, n) velocities as logged.
        slope: (W, n) velocities from the positions.
        acceleration: (W, n) change of the logged velocities.
        tau: (W, n) torques in logged units.
        torque: (W, n) as the description reads the log: sign, gain, bias and friction applied. NaN
            where a joint with a motor's current stands still.
        expected_torque: (W, n) without contact.
        expected_rate: (W, n) how fast that changes [Nm/s].
        wrench: (W, k, 6) as logged.
        expected_wrench: (W, k, 6) on the outboard side, in the sensor's frame, without contact.
        weightless_wrench: the same for a sensor whose driver has taken the weight out.
        wrench_rate, weightless_rate: how fast these change [N/s, Nm/s].
        period: of the samples [s].
    """

    q: Array
    qd: Array
    slope: Array
    acceleration: Array
    tau: Array
    torque: Array
    expected_torque: Array
    expected_rate: Array
    wrench: Array
    expected_wrench: Array
    weightless_wrench: Array
    wrench_rate: Array
    weightless_rate: Array
    period: float

    def __len__(self) -> int:
        return len(self.q)

    def part(self, keep: slice | Index) -> "Windows":
        """Some of the windows."""
        names = JOINT_FIELDS + WRENCH_FIELDS
        return Windows(**{name: getattr(self, name)[keep] for name in names}, period=self.period)

    def ordered(self, robot: Robot, joints: Index, torques: Index) -> "Windows":
        """As if the log's columns stood in another order.

        Args:
            robot: as described.
            joints: (n,) number of the joint in whose columns each position and velocity stands.
            torques: (n,) the same, of the torques.
        """
        q, qd, slope, acceleration = (
            values[:, joints] for values in (self.q, self.qd, self.slope, self.acceleration)
        )
        tau = self.tau[:, torques]
        torque = _read_torques(robot, Samples(np.arange(len(q)), q, qd, tau, self.wrench))
        _hold_nothing(robot, qd, torque)
        moved = replace(
            self, q=q, qd=qd, slope=slope, acceleration=acceleration, tau=tau, torque=torque
        )
        if np.array_equal(joints, np.arange(q.shape[1])):
            return moved  # what is expected of them stays
        # Two samples about the middle of each window, apart from those of the others.
        ways = INSTANT * np.array([-0.5, 0.5])[:, None]
        pairs = np.stack([np.arange(len(q)) + way for way in ways[:, 0]], axis=1).ravel()
        both = [
            (value[:, None] + ways * rate[:, None]).reshape(-1, q.shape[1])
            for value, rate in ((q, qd), (qd, acceleration))
        ]
        nothing = np.zeros_like(both[0]), np.zeros((len(pairs), *self.wrench.shape[1:]))
        seen = _expecting(robot, "none").run(pairs, both[0], both[1], *nothing)
        return replace(
            moved, expected_torque=seen.tau_ext[1::2], expected_wrench=seen.sensor_wrench[1::2]
        )


class WindowMaker:
    """Cuts a recording into windows, part by part."""

    def __init__(self, robot: Robot, period: float) -> None:
        self._robot = robot
        self._rows = max(ROWS, round(SECONDS / period))
        self._period, self._last = period, np.nan
        self._models = [_expecting(robot, compensated) for compensated in ("none", "gravity")]
        self._parts: list[dict[str, Array]] = []
        self._count, self._every = 0, 1

    def add(self, part: Samples) -> None:
        """Take the next samples; what does not fill a window is left out."""
        rows, count = self._rows, len(part) // self._rows
        whole, weightless = (self._expect(model, part) for model in self._models)
        if not count:
            self._last = np.nan
            return
        signals = {
            "q": part.q,
            "qd": part.qd,
            "tau": part.tau,
            "torque": _read_torques(self._robot, part),
            "expected_torque": whole.tau_ext,
            "wrench": part.wrench,
            "expected_wrench": whole.sensor_wrench,
            "weightless_wrench": weightless.sensor_wrench,
        }
        cut = {name: _mean(values, count, rows) for name, values in signals.items()}
        cut["acceleration"] = _rate(part.qd, count, rows) / self._period
        cut["expected_rate"] = _rate(whole.tau_ext, count, rows) / self._period
        cut["wrench_rate"] = _rate(whole.sensor_wrench, count, rows) / self._period
        cut["weightless_rate"] = _rate(weightless.sensor_wrench, count, rows) / self._period
        steps, q = self._steps(part.time, count), part.q[: count * rows]
        shape = (count, rows, q.shape[1])
        ends = q.reshape(shape)[:, -1] - q.reshape(shape)[:, 0]
        span = steps[:, 1:].sum(axis=1)[:, None]
        with np.errstate(invalid="ignore"):
            good = ((steps > 0) & (steps < 3.5 * self._period)).all(axis=1)
            cut["slope"] = np.divide(ends, span, out=np.full_like(ends, np.nan), where=span > 0)
        good &= np.isfinite(cut["q"]).all(axis=1) & np.isfinite(cut["slope"]).all(axis=1)
        self._keep({name: values[good] for name, values in cut.items()})

    def _steps(self, time: Array, count: int) -> Array:
        """Steps (count, rows) [s] that end at each sample; an observer begins anew after a gap."""
        steps = np.diff(time, prepend=self._last)[: count * self._rows]
        self._last = float(time[-1])
        return steps.reshape(count, self._rows)

    def _expect(self, model: Observer, part: Samples):
        nothing = np.zeros_like(part.tau), np.zeros_like(part.wrench)
        return model.run(part.time, part.q, part.qd, *nothing)

    def _keep(self, cut: dict[str, Array]) -> None:
        self._parts.append({name: values[:: self._every] for name, values in cut.items()})
        self._count += len(self._parts[-1]["q"])
        if self._count > 2 * MOST:  # a long recording: every other window will do
            joined = {n: np.concatenate([p[n] for p in self._parts])[::2] for n in self._parts[0]}
            self._parts, self._count, self._every = [joined], len(joined["q"]), 2 * self._every

    def windows(self) -> Windows:
        """All windows."""
        n, k = len(self._robot.joint_names), len(self._robot.sensor_names)
        shapes = dict.fromkeys(JOINT_FIELDS, (n,))
        shapes |= dict.fromkeys(WRENCH_FIELDS, (k, 6))
        parts = self._parts or [{name: np.empty((0, *s)) for name, s in shapes.items()}]
        joined = {name: np.concatenate([p[name] for p in parts]) for name in shapes}
        _hold_nothing(self._robot, joined["qd"], joined["torque"])
        return Windows(**joined, period=self._period)


def _expecting(robot: Robot, compensated: str) -> Observer:
    bare = _bare(robot, compensated)
    return Observer(bare, bandwidth=1e9, method="paper", discretization="exponential")


@lru_cache(maxsize=8)
def _bare(robot: Robot, compensated: str) -> Robot:
    description = robot.description
    sensors = tuple(
        replace(s, compensated=compensated, bias=(0.0,) * 6, polarity="outboard", frame="sensor")
        for s in description.sensors
    )
    joints = tuple(replace(j, bias=0.0, friction=Friction(), rest=None) for j in description.joints)
    return Robot(replace(description, sensors=sensors, joints=joints), robot.mechanism)


def _read_torques(robot: Robot, part: Samples) -> Array:
    torques = part.tau.copy()
    for j, joint in enumerate(robot.description.joints):
        qd, friction = part.qd[:, j], joint.friction
        torques[:, j] = joint.sign * joint.gain * part.tau[:, j] - joint.bias
        torques[:, j] -= friction.dry(qd)
        torques[:, j] -= friction.viscous * qd
        if joint.rest is not None:
            torques[:, j] -= joint.rest.at(part.q[:, j], qd)
    return torques


def _hold_nothing(robot: Robot, qd: Array, torque: Array) -> None:
    """Makes the torques (W, n) of motors NaN where dry friction may hold the joint."""
    for j, joint in enumerate(robot.description.joints):
        if joint.torque == "motor":
            moving = np.abs(qd[:, j]) > DRY_SPEED
            enough = moving.sum() >= ENOUGH
            torque[~moving | ~enough, j] = np.nan


def _rate(values: Array, count: int, rows: int) -> Array:
    """Change (count, ...) per sample, from the ends of the windows."""
    cut = values[: count * rows].reshape(count, rows, *values.shape[1:])
    return (cut[:, -1] - cut[:, 0]) / (rows - 1)


def _mean(values: Array, count: int, rows: int) -> Array:
    """Mean (count, ...) over windows; NaN where less than half of the samples are there."""
    cut = values[: count * rows].reshape(count, rows, *values.shape[1:])
    there = np.isfinite(cut)
    total = np.where(there, cut, 0.0).sum(axis=1)
    number = there.sum(axis=1)
    return np.divide(total, number, out=np.full(total.shape, np.nan), where=number > rows / 2)
