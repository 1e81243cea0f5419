# SPDX-License-Identifier: Apache-2.0
"""Contact or collision, and clamped or free: what kind of touch a segment feels.

A collision begins fast: the force on a segment grows by more than `onset` [N/s], taken over the
last WINDOW, to more than the collision threshold. What has not begun so within PATIENCE is a
contact; a later blow makes it a collision. Forces have passed the observer's low-pass, which shows
a step of F as a rate of at most 0.63 F / WINDOW (bandwidth 100 rad/s).
"""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from touchline.contact.clamping import Clamping
from touchline.contact.thresholds import Thresholds
from touchline.contact.zones import Zones
from touchline.estimation.observer import Estimate, Observer

Array = NDArray[np.float64]

WINDOW = 0.01  # s over which the rate of the force is taken
PATIENCE = 0.05  # s after detection in which a collision would have shown
LEVER = 0.5  # m: where joint torques alone are known, they count as forces at this distance
LEADING = 0.5  # share of a segment's load from which on a blow is that contact's
NOISE_RATIO = 2.0  # contact thresholds per WINDOW that noise may make


class Kind(IntEnum):
    """What is known of a touch."""

    NONE = 0
    UNDECIDED = 1
    CONTACT = 2
    COLLISION = 3


@dataclass(frozen=True)
class Classes:
    """The classifier's view of one sample, or of N samples (N in front).

    Attributes:
        kinds: (m,) the `Kind` of each segment's touch.
        clamped: (m,) whether another segment's force opposes its own.
        rates: (m,) of the segment's force over the last WINDOW [N/s]; NaN where not touched.
    """

    kinds: NDArray[np.int64]
    clamped: NDArray[np.bool_]
    rates: Array

    @staticmethod
    def joined(parts: "Sequence[Classes]") -> "Classes":
        """Views of consecutive samples as one."""
        return Classes(
            np.concatenate([part.kinds for part in parts]),
            np.concatenate([part.clamped for part in parts]),
            np.concatenate([part.rates for part in parts]),
        )


@dataclass
class _Touch:
    """A touch that lasts."""

    begin: float
    kind: int = Kind.UNDECIDED


def of_contact(kinds: NDArray[np.int64], share: Array) -> NDArray[np.int64]:
    """Kinds (M,) of single contacts, from those of their segment and their shares of its load.

    A blow on a segment that is touched at several places belongs to the one that carries most.
    """
    return np.where(share >= LEADING, kinds, np.minimum(kinds, Kind.CONTACT))


class Classifier:
    """Follows the samples of a pipeline; the same in whatever parts they come.

    Args:
        observer: that makes the estimates.
        thresholds: of the detector.
        zones: of the robot.
    """

    def __init__(self, observer: Observer, thresholds: Thresholds, zones: Zones) -> None:
        self._observer, robot = observer, observer.robot
        m = len(robot.segment_names)
        self._root = robot.segment_names.index("root") if "root" in robot.segment_names else -1
        rows = thresholds.rows
        self._root_joints = [row.joint for row in rows if row.segment == self._root]
        self._onset, self._collision = np.full((2, m), np.inf)
        for g, segment in enumerate(robot.segment_names):
            own = [row for row in rows if row.segment == g and row.component in (0, 1, 2)]
            unit = 1.0 if own else 1.0 / LEVER
            own = own or [row for row in rows if row.segment == g and row.joint >= 0]
            if own:
                noise = NOISE_RATIO * unit * max(row.contact for row in own) / WINDOW
                self._onset[g] = max(zones.onset(segment), noise)
                self._collision[g] = unit * min(row.collision for row in own)
        description = robot.description
        joints = float(np.max(description.bandwidth_joints, initial=1.0))
        known = description.bandwidth_sensors
        self._bandwidth = np.array([known.get(name, joints) for name in robot.segment_names])
        self._clamping = Clamping()
        self._time, self._size = np.empty(0), np.empty((0, m))
        self._waiting: deque[tuple[float, Array]] = deque()
        self._touches: dict[int, _Touch] = {}

    def wait(self, time: float, estimate: Estimate) -> None:
        """Takes one sample in which nothing touches; as `follow`, but quick."""
        if self._touches:
            self._touches = {}
            self._clamping.reset()
        self._waiting.append((time, estimate.rows))
        while len(self._waiting) > 1 and self._waiting[1][0] <= time - WINDOW:
            self._waiting.popleft()

    def follow(self, time: Array, estimate: Estimate, levels: NDArray) -> Classes:
        """Takes N samples.

        Args:
            time: (N,) [s].
            estimate: of these samples.
            levels: (N, m) of the detection.
        """
        if self._waiting:
            stamps, rows = zip(*self._waiting, strict=True)
            self._waiting.clear()
            self._keep(np.array(stamps), self._sizes(self._observer.estimate(np.array(rows))))
        past = len(self._time)
        self._keep(np.asarray(time, float), self._sizes(estimate), cut=False)
        kinds = np.zeros(levels.shape, dtype=np.int64)
        rates = np.full(levels.shape, np.nan)
        touched = np.flatnonzero((levels > 0).any(axis=1))
        rates[touched] = self._rates(past + touched)
        rates[levels == 0] = np.nan
        strong = self._size[past:] + rates / self._bandwidth > self._collision
        fast = (rates > self._onset) & strong
        for g in range(levels.shape[1]):
            if g in self._touches or levels[:, g].any():
                self._decide(g, self._time[past:], levels[:, g] > 0, fast[:, g], kinds[:, g])
        clamped = self._clamping.follow(self._time[past:], estimate, levels)
        self._keep(np.empty(0), self._size[:0])
        return Classes(kinds, clamped, rates)

    def _sizes(self, estimate: Estimate) -> Array:
        """Size of each segment's force (N, m) [N]."""
        sizes = np.linalg.norm(estimate.segment_wrench[..., :3], axis=-1)
        if self._root >= 0 and self._root_joints:
            torques = np.abs(np.nan_to_num(estimate.segment_torque[:, self._root_joints]))
            sizes[:, self._root] = torques.max(axis=1) / LEVER
        return sizes

    def _keep(self, time: Array, sizes: Array, cut: bool = True) -> None:
        """Adds to what is remembered, and forgets what is older than WINDOW."""
        self._time = np.fmax.accumulate(np.concatenate([self._time, time]))
        self._size = np.concatenate([self._size, sizes])
        if cut and len(self._time):
            first = np.searchsorted(self._time, self._time[-1] - WINDOW, "right") - 1
            self._time, self._size = self._time[max(first, 0) :], self._size[max(first, 0) :]

    def _rates(self, rows: NDArray[np.int64]) -> Array:
        """How fast the sizes grew over the WINDOW before some of the remembered samples."""
        then = np.searchsorted(self._time, self._time[rows] - WINDOW, "right") - 1
        then = np.maximum(then, 0)
        span = (self._time[rows] - self._time[then])[:, None]
        grown = self._size[rows] - self._size[then]
        return np.divide(grown, span, out=np.zeros_like(grown), where=span > 0)

    def _decide(
        self, g: int, time: Array, active: NDArray, fast: NDArray, kinds: NDArray[np.int64]
    ) -> None:
        """Writes the kinds (N,) of one segment's touches."""
        edges = np.flatnonzero(np.diff(active.astype(int), prepend=int(g in self._touches)))
        bounds = sorted({0, *edges.tolist(), len(time)})  # an edge may be the first sample
        for start, stop in zip(bounds[:-1], bounds[1:], strict=True):
            if start in edges and not active[start]:
                del self._touches[g]
            if start == stop or not active[start]:
                continue
            touch = self._touches.setdefault(g, _Touch(float(time[start])))
            part = kinds[start:stop]
            part[:] = touch.kind
            if touch.kind == Kind.UNDECIDED:
                part[time[start:stop] >= touch.begin + PATIENCE] = Kind.CONTACT
            blows = np.flatnonzero(fast[start:stop])
            if len(blows):
                part[blows[0] :] = Kind.COLLISION
            if touch.kind == Kind.COLLISION:
                part[:] = Kind.COLLISION
            touch.kind = int(part[-1])
