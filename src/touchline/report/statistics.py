# SPDX-License-Identifier: Apache-2.0
"""Figures of a whole recording, gathered part by part."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index, Mask
from touchline.detector.detector import Detection
from touchline.health import Health
from touchline.observer.observer import Estimate
from touchline.result.kinds import Watch


class Moments:
    """Root mean square, mean and largest magnitude of columns (c,); NaN does not count."""

    def __init__(self, columns: int) -> None:
        self.count = np.zeros(columns, dtype=int)
        self._sum, self._squares = np.zeros(columns), np.zeros(columns)
        self._largest = np.zeros(columns)

    @classmethod
    def of(cls, columns: Array, used: Mask) -> "Moments":
        """Those of columns (c, N), each in one piece, where (c, N) is true."""
        moments = cls(len(columns))
        if not columns.size:
            return moments
        moments.count[:] = columns.shape[1]
        squares = np.einsum("ij,ij->i", columns, columns)
        if not (used.all() and np.isfinite(squares).all()):
            used = used & np.isfinite(columns)
            columns = np.where(used, columns, 0.0)
            moments.count[:] = np.count_nonzero(used, axis=1)
            squares = np.einsum("ij,ij->i", columns, columns)
        moments._sum, moments._squares = columns.sum(axis=1), squares
        moments._largest = np.maximum(columns.max(axis=1), -columns.min(axis=1))
        return moments

    def __iadd__(self, other: "Moments") -> "Moments":
        self.count += other.count
        self._sum += other._sum
        self._squares += other._squares
        self._largest = np.maximum(self._largest, other._largest)
        return self

    def _per_sample(self, total: Array) -> Array:
        return np.divide(total, self.count, out=np.full(len(total), np.nan), where=self.count > 0)

    @property
    def mean(self) -> Array:
        """Mean (c,); NaN without samples."""
        return self._per_sample(self._sum)

    @property
    def rms(self) -> Array:
        """Root mean square (c,); NaN without samples."""
        return np.sqrt(self._per_sample(self._squares))

    @property
    def largest(self) -> Array:
        """Largest magnitude (c,); NaN without samples."""
        return np.where(self.count > 0, self._largest, np.nan)


@dataclass
class Clock:
    """Time stamps: first and last [s], and the longest step."""

    rows: int = 0
    first: float = np.nan
    last: float = np.nan
    longest: float = 0.0

    def add(self, time: Array) -> None:
        """Take N stamps."""
        self.rows += len(time)
        stamps = time[np.isfinite(time)]
        if not len(stamps):
            return
        if np.isnan(self.first):
            self.first = float(stamps[0])
        else:
            stamps = np.concatenate([[self.last], stamps])
        self.longest = max(self.longest, float(np.diff(stamps).max(initial=0.0)))
        self.last = float(stamps[-1])

    @property
    def duration(self) -> float:
        """From the first stamp to the last [s]."""
        return self.last - self.first

    @property
    def rate(self) -> float:
        """Samples per second on average; NaN where time stands still."""
        return (self.rows - 1) / self.duration if self.duration > 0 else np.nan


@dataclass
class Statistics:
    """What a recording's samples amount to.

    Attributes:
        clock: time stamps.
        health: samples with each health bit.
        healthy: samples without any.
        torque: external joint torques, all settled samples.
        quiet_torque: the same while nothing touches.
        wrench: segment wrenches (6 m columns), all settled samples.
        quiet_wrench: the same while nothing touches.
        watch: (m, 3) settled samples in which each segment was watched, degraded and blind.
    """

    torque: Moments
    quiet_torque: Moments
    wrench: Moments
    quiet_wrench: Moments
    watch: Index
    clock: Clock = field(default_factory=Clock)
    health: dict[Health, int] = field(default_factory=lambda: dict.fromkeys(Health, 0))
    healthy: int = 0

    @classmethod
    def of(cls, joints: int, segments: int) -> "Statistics":
        """Statistics of nothing yet."""
        torques, wrenches = (Moments(joints), Moments(joints)), (Moments(6 * segments),)
        watch = np.zeros((segments, len(Watch)), np.int64)
        return cls(*torques, *wrenches, Moments(6 * segments), watch)

    def add(
        self, time: Array, estimate: Estimate, detection: Detection, watch: NDArray[np.int8]
    ) -> None:
        """Take N samples; `watch` (N, m): numbers of `Watch`."""
        health = estimate.health
        settled = (health & Health.SETTLING) == 0
        seen = watch if settled.all() else watch[settled]
        for segment, states in enumerate(seen.T):
            self.watch[segment] += np.bincount(states, minlength=len(Watch))
        self.clock.add(time)
        self.healthy += int((health == 0).sum())
        any_of = int(np.bitwise_or.reduce(health, initial=0))
        for bit in Health:
            if bit & any_of:
                self.health[bit] += int(np.count_nonzero(health & bit))
        touched = detection.touched
        any_touch = bool(touched.any())
        wrench = estimate.segment_wrench.reshape(len(time), -1)
        of_wrenches = np.repeat(estimate.segment_settled.T, 6, axis=0)
        for values, used, all_of, without_touch in (
            (estimate.tau_ext, estimate.joint_settled.T, self.torque, self.quiet_torque),
            (wrench, of_wrenches, self.wrench, self.quiet_wrench),
        ):
            columns = np.array(values.T, order="C")
            if any_touch:
                felt, of_felt = np.compress(touched, columns, 1), np.compress(touched, used, 1)
                all_of += Moments.of(felt, of_felt)
                columns, used = np.compress(~touched, columns, 1), np.compress(~touched, used, 1)
            moments = Moments.of(columns, used)
            all_of += moments
            without_touch += moments
