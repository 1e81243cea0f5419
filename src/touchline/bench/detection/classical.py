# SPDX-License-Identifier: Apache-2.0
"""The classical observer in the detection benchmark: what its rows show over hours of motion.

`estimation.classical.ClassicalObserver` at a tenth of its cost: accelerations from eq. (6) of
Iskandar et al., ICRA 2021, and Newton-Euler at the sensors are linear in the readings and, so far
as noise matters, in the noise of the velocities. Their coefficients are as smooth as the motion;
they are computed at a low rate and interpolated like the loads. The joint residual is the native
observer's. All seven joints have torque sensors here, without which there is no eq. (6).
"""

from collections.abc import Iterable, Iterator
from functools import lru_cache

import numpy as np

from touchline.arrays import Array, Mask
from touchline.bench.detection.pushes import AFTER, BEFORE, PushMaker, random_pushes
from touchline.bench.detection.work import (
    CALIBRATED,
    PUSHED,
    SECONDS,
    Setting,
    description,
    maker,
)
from touchline.detector.calibration import BLOCK, Statistics
from touchline.detector.thresholds import make_thresholds
from touchline.model.robot import Robot
from touchline.observer.classical import moved_mass
from touchline.observer.dynamics import inverse_dynamics, mass_matrix, posture
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples
from touchline.trials.free_motion import (
    MotionMaker,
    Path,
    Trajectory,
    generator,
    random_trajectory,
)

_Recording = tuple[Trajectory, Samples]

# The wrench as it comes, and low-passed once more with the bandwidth of the joint residual.
METHODS = ("rows", "lowpass")
CHUNK = 4000  # samples whose matrices are held at a time


class FastClassical:
    """The classical estimates of recordings of a known path.

    Args:
        maker: made the recordings; its robot has plain six-axis sensors, one a segment, and plain
            torque sensors in all joints.
    """

    def __init__(self, maker: MotionMaker) -> None:
        self._maker = maker
        self._segments = _Segments(maker.robot)

    def run(self, path: Path, s: Samples) -> tuple[Array, Array, Mask]:
        """External joint torques (N, n), segment wrenches (N, m, 6) in the frames of the sensors.

        The third is where the joint residuals have settled (N,).
        """
        maker, robot = self._maker, self._maker.robot
        estimate = Observer(robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
        residual, n = estimate.tau_ext, len(robot.joint_names)
        coarse = self.coefficients(*path(maker.coarse)[:2])
        size = 6 * len(robot.segment_names)
        noise = s.qd - path(s.time)[1]
        one, wrench = np.ones((len(s.q), 1)), s.wrench.reshape(len(s.q), -1)
        known = np.hstack([s.tau + residual, noise, one, wrench])
        out = np.empty((len(s.q), size))
        step = max(1, CHUNK // maker.factor) * maker.factor
        for start in range(0, len(s.q), step):
            rows = slice(start, min(start + step, len(s.q)))
            G = maker.interpolated(coarse, rows).reshape(-1, size, 2 * n + 1 + wrench.shape[1])
            out[rows] = (G @ known[rows, :, None])[..., 0]
        settled = np.asarray(estimate.joint_settled).all(axis=1)
        return residual, out.reshape(len(s.q), -1, 6), np.atleast_1d(settled)

    def coefficients(self, q: Array, qd: Array) -> Array:
        """What segment wrenches are made of, (N, 6 m, n + n + 1 + 6 k) in one row each.

        Factors of the joint torques with the residual, of the velocities' noise, what the motion
        itself needs, and factors of the sensors' readings.
        """
        robot, n = self._maker.robot, q.shape[1]
        M, M_vq = moved_mass(robot, q), mass_matrix(robot, q)[1]
        k = M_vq.shape[1]
        A = M_vq.reshape(len(q), 6 * k, n) @ np.linalg.inv(M)
        # Quadratic in the velocities, of which central differences are exact derivatives.
        at = np.stack([qd, *(qd + e for e in np.eye(n)), *(qd - e for e in np.eye(n))], axis=1)
        needed = inverse_dynamics(robot, q[:, None], at, np.zeros_like(at))
        torque, wrench = needed.torque, needed.wrench.reshape(len(q), -1, 6 * k)
        rest = wrench - np.einsum("nij,naj->nai", A, torque)
        slope = np.swapaxes(0.5 * (rest[:, 1 : n + 1] - rest[:, n + 1 :]), 1, 2)
        readings = np.broadcast_to(-np.eye(6 * k), (len(q), 6 * k, 6 * k))
        at_sensors = np.concatenate([A, slope, rest[:, 0, :, None], readings], axis=2)
        return (self._segments.matrix(q) @ at_sensors).reshape(len(q), -1)


class _Segments:
    """Segment wrenches as differences of sensor wrenches, eq. (18)."""

    def __init__(self, robot: Robot) -> None:
        self._robot = robot
        self._nodes = [
            next(i for i, node in enumerate(robot.nodes) if node.sensor == name)
            for name in robot.sensor_names
        ]

    def matrix(self, q: Array) -> Array:
        """(N, 6 m, 6 k), from the sensors' frames to those of the segments' own sensors."""
        robot, placed = self._robot, posture(self._robot, q)
        number = robot.sensor_names.index
        P = np.zeros((len(q), len(robot.segment_names), 6, len(robot.sensor_names), 6))
        for g, segment in enumerate(robot.segment_names):
            own = number(segment)
            P[:, g, :, own] += np.eye(6)
            for successor in robot.successors(segment):
                other = number(successor)
                R, p = (
                    [x[self._nodes[s]] for s in (own, other)]
                    for x in (placed.rotation, placed.origin)
                )
                back = np.swapaxes(R[0], 1, 2)
                turn, arm = back @ R[1], (back @ (p[1] - p[0])[..., None])[..., 0]
                P[:, g, :3, other, :3] -= turn
                P[:, g, 3:, other, 3:] -= turn
                P[:, g, 3:, other, :3] -= np.cross(arm[:, :, None], turn, axis=1)
        return P.reshape(len(q), 6 * len(robot.segment_names), -1)


def less_baseline(residual: Array, period: float, time: float) -> Array:
    """Residuals (N, r) less their slow baseline, as the detector follows it while it never fires.

    A running mean first, a low-pass with the time constant `time` [s] once it has seen as much.
    """
    count = min(round(time / period), len(residual))
    mean = np.cumsum(residual[:count], axis=0) / np.arange(1, count + 1)[:, None]
    rest = _lowpassed(residual[count:], 1.0 - period / time, mean[-1])
    baseline = np.concatenate([residual[:1], mean, rest])[: len(residual)]
    return residual - baseline


def _lowpassed(x: Array, a: float, start: Array) -> Array:
    """`y[i] = a y[i - 1] + (1 - a) x[i]` along the first axis, with `y[-1] = start`."""
    from scipy.signal import lfilter

    return lfilter([1.0 - a], [1.0, -a], x, axis=0, zi=a * start[None])[0] if len(x) else x


class _Rows:
    """The rows of the detector, from the classical estimates.

    Args:
        setting: what is simulated.
        seconds: length of a recording.
    """

    def __init__(self, setting: Setting, seconds: float) -> None:
        self.maker = maker(setting, seconds)
        self._classical = FastClassical(self.maker)
        robot, self._period = self.maker.robot, 1.0 / setting.rate
        self._rows = make_thresholds(robot, self._period).rows
        self._baseline = robot.description.detection.baseline.time
        self._decay = float(np.exp(-min(robot.description.bandwidth_joints) * self._period))

    def offsets(self, path: Path, s: Samples) -> Iterator[Array]:
        """Residuals less their baselines (N, r) [N or Nm] by method; 0 before they have settled."""
        torque, wrench, settled = self._classical.run(path, s)
        first = int(np.argmax(settled))
        plain = np.stack(
            [
                torque[:, row.joint] if row.component < 0 else wrench[:, row.segment, row.component]
                for row in self._rows
            ],
            axis=1,
        )
        smooth = _lowpassed(plain, self._decay, plain[0])
        is_torque = np.array([row.component < 0 for row in self._rows])
        smooth[:, is_torque] = plain[:, is_torque]  # a low-pass is in them already
        for values in (plain, smooth):
            values[first:] = less_baseline(values[first:], self._period, self._baseline)
            values[:first] = 0.0
            yield values

    def statistics(self, path: Path, s: Samples, typical: Array) -> Array:
        """The largest row of each segment in units of what is typical of it (N, m, methods)."""
        segment = np.array([row.segment for row in self._rows])
        out = np.empty((len(s.q), len(self.maker.robot.segment_names), len(METHODS)))
        for t, offsets in enumerate(self.offsets(path, s)):
            x = np.abs(offsets) / typical[t]
            for g in range(out.shape[1]):
                out[:, g, t] = x[:, segment == g].max(axis=1)
        return out


@lru_cache(maxsize=4)
def _rows(setting: Setting, seconds: float = SECONDS) -> _Rows:
    return _Rows(setting, seconds)


def _recordings(setting: Setting, seed: int, numbers: Iterable[int]) -> Iterator[_Recording]:
    make = maker(setting)
    for number in numbers:
        rng = generator(seed, number)
        path = random_trajectory(make.robot, rng)
        yield path, make.samples(path, rng)


def row_figures(setting: Setting, count: int) -> Array:
    """Root mean squares (methods, r) of the rows in `count` contact-free recordings."""
    squares = [
        [np.mean(x**2, axis=0) for x in _rows(setting).offsets(*recording)]
        for recording in _recordings(setting, CALIBRATED, range(count))
    ]
    return np.sqrt(np.mean(squares, axis=0))


def statistics(setting: Setting, typical: Array, seed: int, numbers: range) -> Statistics:
    """The statistics in some recordings."""
    per_block = max(1, round(BLOCK * setting.rate))
    blocks, times, which = [], [], []
    for number, (path, s) in enumerate(_recordings(setting, seed, numbers)):
        values = _rows(setting).statistics(path, s, typical)
        whole = len(values) // per_block * per_block
        largest = values[:whole].reshape(-1, per_block, *values.shape[1:]).max(axis=1)
        blocks += [largest, np.full((1, *largest.shape[1:]), np.nan)]
        times += [s.time[:whole:per_block], np.full(1, np.nan)]
        which.append(np.full(len(largest) + 1, number))
    hours = len(numbers) * SECONDS / 3600
    return Statistics(np.concatenate(blocks), np.concatenate(times), np.concatenate(which), hours)


def push_statistics(setting: Setting, typical: Array, force: float, numbers: range) -> Array:
    """Statistics (trials, samples, methods) on the structure, from the onset of pushes on."""
    rows = _rows(setting, BEFORE + AFTER)
    make = PushMaker(rows.maker)
    skin_robot = description("sara", setting.velocity)  # the same places in every layout
    found = []
    for number, push in enumerate(random_pushes(skin_robot, numbers.stop, PUSHED)):
        if number < numbers.start:
            continue
        s = make.samples(push, force, generator(PUSHED, number, round(1000 * force)))
        found.append(rows.statistics(push.path(), s, typical)[make.first - 1 :, 0])
    return np.array(found)
