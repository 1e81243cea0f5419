# SPDX-License-Identifier: Apache-2.0
"""Touches of a standing arm that are too soft for the detector, but not for a spot that was taught.

The detector's limits allow for what motion and an imperfect model do to the torques. While the arm
stands, neither changes: a step is a touch once it stands out of the noise. It counts only if it is
at least half as strong as the softest touch that taught a spot in this posture.
"""

from collections import deque
from dataclasses import dataclass, field

import numpy as np

from touchline.arrays import Array
from touchline.touch.gesture import EASING, LIFTED
from touchline.touch.spot import AVERAGE, BEFORE, LEAST_STEP, LIKELIER, TorqueSpots

BLOCK = 0.01  # s, over which torques are averaged before anything else
EDGE = 3  # blocks, over which the beginning and the end of a touch are looked for
QUIET = 5  # blocks at least that say what the torques at rest are
MOVED = 0.005  # rad or m in BEFORE; what moves farther does not stand
SOFTEST = 0.5  # of the softest touch that taught a spot; what is softer was not meant
SIGMAS = 6.0  # of the noise, by which a step stands out
DWELL = 0.15  # s; then the mean of a step holds nothing of its rise
LATEST = 1.0  # s; what is on no spot by then is on none


@dataclass
class _Step:
    begun: float  # [s]
    resting: Array  # torques (n,) [Nm] before it
    noise: float  # of a block at rest, rms of its norm [Nm]
    peak: float = 0.0  # [Nm]
    name: str | None = None  # of the spot that was told
    over: bool = False  # told by a contact, or on none
    easing: float | None = None  # [s], since when it falls
    blocks: deque[Array] = field(default_factory=lambda: deque(maxlen=round(AVERAGE / BLOCK)))


class SoftTouch:
    """Follows the torques of an arm without force-torque sensors.

    Args:
        spots: that were taught.
    """

    def __init__(self, spots: TorqueSpots) -> None:
        self._spots = spots
        self._sum: Array | None = None
        self._count, self._begun = 0, -np.inf
        self._blocks: deque[tuple[float, Array, Array]] = deque(maxlen=round(BEFORE[0] / BLOCK))
        self._step: _Step | None = None

    @property
    def resting(self) -> Array | None:
        """Torques (n,) [Nm] before the touch that lasts; None without one."""
        return None if self._step is None else self._step.resting

    @property
    def name(self) -> str | None:
        """The spot that is pressed; None without one."""
        return None if self._step is None else self._step.name

    def leave(self) -> None:
        """A contact tells of this touch from now on."""
        if self._step is not None:
            self._step.name, self._step.over = None, True

    def follow(
        self, time: float, q: Array, torque: Array, felt: bool
    ) -> tuple[str, str, float] | None:
        """Takes a sample: "press" or "release", of which spot, with which probability.

        Args:
            time: [s].
            q: joint positions (n,) [rad or m].
            torque: external torques (n,) [Nm].
            felt: whether the detector feels a contact, which is to tell then.
        """
        self._sum = torque if self._sum is None else self._sum + torque
        self._count += 1
        if time - self._begun < BLOCK:
            return None
        mean = self._sum / self._count
        self._sum, self._count, self._begun = None, 0, time
        if self._blocks and (
            time - self._blocks[-1][0] > 5 * BLOCK or np.abs(q - self._blocks[0][1]).max() > MOVED
        ):
            return self._end()
        self._blocks.append((time, q, mean))
        if self._step is None:
            self._look(time, q)
            return None
        return self._press(self._step, time, q, felt)

    def _look(self, time: float, q: Array) -> None:
        """Does a touch begin?"""
        early = [block for at, _, block in self._blocks if at <= time - BEFORE[1]]
        if len(early) < QUIET:
            return
        resting = np.median(early, axis=0)
        last = np.mean([block for _, _, block in list(self._blocks)[-EDGE:]], axis=0)
        if _size(last - resting) >= self._least(q):
            noise = float(np.median([_size(block - resting) for block in early]))
            self._step = _Step(time - EDGE * BLOCK, resting, noise)

    def _press(
        self, step: _Step, time: float, q: Array, felt: bool
    ) -> tuple[str, str, float] | None:
        last = np.mean([block for _, _, block in list(self._blocks)[-EDGE:]], axis=0)
        size = _size(last - step.resting)
        step.peak = max(step.peak, size)
        step.blocks.append(self._blocks[-1][2] - step.resting)
        if size < LIFTED * step.peak:
            step.easing = time if step.easing is None else step.easing
            return self._end() if time - step.easing >= EASING else None
        step.easing, age = None, time - step.begun
        if step.name is not None or step.over or felt or age < DWELL:
            return None
        if age > LATEST:
            step.over = True
            return None
        mean = np.mean(step.blocks, axis=0)
        if _size(mean) < max(self._least(q), SIGMAS * step.noise / np.sqrt(len(step.blocks))):
            return None
        name, probability = self._spots.read(q, mean)[0]
        if name is None or probability < LIKELIER:
            return None
        step.name = name
        return "press", name, probability

    def _end(self) -> tuple[str, str, float] | None:
        name = self.name
        self._step = None
        self._blocks.clear()
        return None if name is None else ("release", name, 1.0)

    def _least(self, q: Array) -> float:
        return max(LEAST_STEP, SOFTEST * self._spots.least(q))


def _size(torque: Array) -> float:
    return float(np.linalg.norm(np.nan_to_num(torque)))
