# SPDX-License-Identifier: Apache-2.0
"""Spots that joint torques alone tell: by the direction of the torque step that a touch brings.

In one posture a push at one place in one direction always brings torques in the same proportion,
whatever its force. So a spot is taught by touching it, and told from others and from touches
elsewhere ("none of them") by its direction in the space of joint torques.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import lgamma, log, pi

import numpy as np
from numpy.typing import NDArray

from touchline.localizer.skin import Skin
from touchline.model.description import TaughtTouch

Array = NDArray[np.float64]

REPEAT = 0.02  # rad: how well a hand repeats a direction before anything was taught (1 degree)
REPEAT_COUNT = 5  # touches that this prior counts for
ELSEWHERE = 0.5  # rad: spread of the directions of touches elsewhere, in parts of the lever arms
POSTURE = 0.1  # rad (rms over the joints): farther from where it was taught a spot is not told
STEP_NOISE = 0.05  # Nm: what noise and stiction leave in a step of one joint
BEFORE = 0.3, 0.03  # s: from when to when before a touch its torques are taken as those at rest
AVERAGE = 0.05  # s, over which the direction of a torque step is averaged
LEAST_STEP = 0.3  # Nm; smaller steps have no direction worth the name
LEAST_LEVER = 0.05  # m, of a joint about whose axis everything outboard is close


@dataclass(frozen=True)
class _Spot:
    name: str
    q: Array
    direction: Array
    count: int


class TorqueSpots:
    """Tells taught spots by torque steps.

    Args:
        taught: the touches that taught each spot.
        skin: of the robot: its lever arms say how much each joint's part may vary.
    """

    def __init__(self, taught: Mapping[str, Sequence[TaughtTouch]], skin: Skin) -> None:
        self._skin = skin
        self._spots: list[_Spot] = []
        scatter: list[Array] = []
        for name, touches in taught.items():
            for q, steps in _by_posture(touches):
                units = steps / np.linalg.norm(steps, axis=1, keepdims=True)
                middle = units.mean(axis=0)
                self._spots.append(_Spot(name, q, middle / np.linalg.norm(middle), len(units)))
                scatter.append(units - middle)
        self._scatter = np.vstack(scatter) if scatter else np.empty((0, 0))
        self._degrees = REPEAT_COUNT + len(self._scatter) - len(self._spots)
        self._prepared: dict[bytes, tuple[Array, Array]] = {}

    @property
    def names(self) -> tuple[str, ...]:
        """Of all spots."""
        return tuple(dict.fromkeys(spot.name for spot in self._spots))

    def read(self, q: Array, step: Array) -> list[tuple[str | None, float]]:
        """Which spot a touch is on: (name, probability), best first; None: none of them.

        Args:
            q: joint positions (n,) [rad or m].
            step: (n,) change of the external torque by the touch [Nm]; NaN where not measured.
        """
        near = [s for s in self._spots if np.sqrt(np.mean((s.q - q) ** 2)) < POSTURE]
        known = np.isfinite(step)
        size = float(np.linalg.norm(step[known]))
        if not near or size < LEAST_STEP:
            return [(None, 1.0)]
        levers, within = self._spread(near[0].q)
        noise = (STEP_NOISE / size) ** 2 * np.eye(len(step))
        unit = np.where(known, step / size, 0.0)
        part = np.ix_(known, known)
        scores: list[tuple[str | None, float]] = []
        for spot in near:
            spread = (within * (1.0 + 1.0 / spot.count) + noise)[part]
            off = (unit - spot.direction)[known]
            scores.append((spot.name, _log_student(off, spread, self._degrees) - log(len(near))))
        around = (np.diag((ELSEWHERE * levers) ** 2) + noise)[part]
        scores.append((None, _log_normal(unit[known], around)))
        return _shares(scores)

    def read_event(
        self, time: Array, q: Array, torque: Array, begin: float, end: float
    ) -> list[tuple[str | None, float]]:
        """Which spot a touch between two instants [s] was on, as `read`.

        Args:
            time: (N,) [s], from before the touch to its end or later.
            q: joint positions (N, n) [rad or m].
            torque: (N, n) external torques [Nm].
            begin: when it was detected.
            end: when it was cleared, or the last instant.
        """
        before = (time >= begin - BEFORE[0]) & (time <= begin - BEFORE[1])
        during = np.flatnonzero((time >= begin) & (time <= end))
        if not before.any() or not len(during):
            return [(None, 1.0)]
        steps = torque[during] - torque[before].mean(axis=0)
        mean = np.array(
            [steps[np.abs(time[during] - time[row]) <= AVERAGE / 2].mean(axis=0) for row in during]
        )
        largest = int(np.argmax(np.linalg.norm(np.nan_to_num(mean), axis=1)))
        return self.read(q[during[largest]], mean[largest])

    def _spread(self, q: Array) -> tuple[Array, Array]:
        """Lever arms (n,) in parts of the longest, and the spread (n, n) of a spot's direction."""
        key = q.tobytes()
        if key not in self._prepared:
            levers = lever_arms(self._skin, q)
            levers /= levers.max()
            prior = REPEAT_COUNT * np.diag((REPEAT * levers) ** 2)
            total = prior + self._scatter.T @ self._scatter
            self._prepared[key] = levers, total / self._degrees
        return self._prepared[key]


def lever_arms(skin: Skin, q: Array) -> Array:
    """The longest arm (n,) [m] that a force on a link outboard of each joint has about its axis."""
    robot = skin.robot
    poses = robot.poses(q)
    levers = np.full(len(robot.joint_names), LEAST_LEVER)
    for patch in skin.patches:
        T = poses[patch.node] @ patch.T_node_link
        points = patch.surface.vertices @ T[:3, :3].T + T[:3, 3]
        node = patch.node
        while node >= 0:
            here, pose = robot.nodes[node], poses[node]
            if here.coordinate >= 0:
                arm = 1.0  # a prismatic joint carries the force itself
                if here.kind == "revolute":
                    arm = np.linalg.norm(np.cross(points - pose[:3, 3], pose[:3, 2]), axis=1).max()
                levers[here.coordinate] = max(levers[here.coordinate], arm)
            node = here.parent
    return levers


def _by_posture(touches: Sequence[TaughtTouch]) -> list[tuple[Array, Array]]:
    """Joint positions (n,) of each posture, and the steps (K, n) taught there."""
    postures: list[tuple[Array, list[Array]]] = []
    for touch in touches:
        q, step = np.array(touch.q), np.array(touch.step)
        for known, steps in postures:
            if np.sqrt(np.mean((known - q) ** 2)) < POSTURE:
                steps.append(step)
                break
        else:
            postures.append((q, [step]))
    return [(q, np.array(steps)) for q, steps in postures]


def _log_student(x: Array, spread: Array, degrees: int) -> float:
    n = len(x)
    distance = float(x @ np.linalg.solve(spread, x))
    return (
        lgamma((degrees + n) / 2)
        - lgamma(degrees / 2)
        - 0.5 * n * log(degrees * pi)
        - 0.5 * float(np.linalg.slogdet(spread)[1])
        - 0.5 * (degrees + n) * log(1.0 + distance / degrees)
    )


def _log_normal(x: Array, spread: Array) -> float:
    distance = float(x @ np.linalg.solve(spread, x))
    return -0.5 * (distance + float(np.linalg.slogdet(spread)[1]) + len(x) * log(2 * pi))


def _shares(scores: list[tuple[str | None, float]]) -> list[tuple[str | None, float]]:
    highest = max(score for _, score in scores)
    sums: dict[str | None, float] = {}
    for name, score in scores:
        sums[name] = sums.get(name, 0.0) + float(np.exp(score - highest))
    total = sum(sums.values())
    return sorted(((name, x / total) for name, x in sums.items()), key=lambda pair: -pair[1])
