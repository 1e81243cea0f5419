# SPDX-License-Identifier: Apache-2.0
"""A hand that closes around a link: felt as a second push that misses the finger's place.

Thumb and fingers press against each other, so a sensor inboard feels only their difference. When
the fingers close, the force falls although the thumb stays. A finger that merely eases takes away
a force on its own line; the fingers of a hand add one on another line, across the link.
"""

from collections import deque
from operator import itemgetter

import numpy as np

from touchline.arrays import Array

PAUSE = 0.005  # s between two looks: a hand closes in some 50 ms
STEADY = 0.1  # s for which the hand has to hold: a finger that slides or lifts is never so still
MEMORY = 0.35  # s, within which a hand closes and holds
LESS = 0.25  # of the force that a closing hand takes away at least; what it leaves is not steady
REST = 0.1  # of the force that has to be left, or nothing is held
WAVER = 0.25  # of the force by which a holding hand may vary
STILL = 0.004  # m by which the line of force may move about while a hand holds
MISS = 0.006  # m by which the second push misses the thumb's place at least: places are no sharper
REACH = 0.12  # m at most; what is farther is no part of the same hand
CLEAR = 0.0015  # m, 1 sigma, of that distance


class Grip:
    """Watches one press for a hand that closes; all in the frame of the link."""

    def __init__(self) -> None:
        self._past: deque[tuple[float, Array, Array, float]] = deque()

    def due(self, time: float) -> bool:
        """Whether it has been so long since the last look that another one tells more."""
        return not self._past or time - self._past[-1][0] >= PAUSE

    def follow(self, time: float, wrench: Array, point: Array) -> float:
        """How far the second push misses the finger's place [m]; 0 where there is none.

        Args:
            time: of the sample [s].
            wrench: (6,) [N, Nm] on the segment, in link axes about the link's origin.
            point: (3,) [m] where the finger is felt.
        """
        past, size = self._past, float(np.linalg.norm(wrench[:3]))
        past.append((time, wrench, point, size))
        while past[0][0] < time - MEMORY:
            past.popleft()
        _, before, place, force = max(past, key=itemgetter(3))
        if time - past[0][0] < STEADY or not REST * force < size < (1.0 - LESS) * force:
            return 0.0
        held = np.array([w for t, w, _, _ in past if t >= time - STEADY])
        middle = held.mean(axis=0)
        spread = np.ptp(np.linalg.norm(held[:, :3], axis=1))
        if spread > WAVER * np.linalg.norm(middle[:3]):
            return 0.0
        lines = [_miss(w, place) for w in held[:: max(1, len(held) // 8)]]
        if max(float(np.linalg.norm(line - lines[-1])) for line in lines) > STILL:
            return 0.0
        second = middle - before
        if float(second[:3] @ before[:3]) >= -0.5 * np.linalg.norm(second[:3]) * force:
            return 0.0
        miss = float(np.linalg.norm(_miss(second, place)))
        return miss if MISS < miss < REACH else 0.0


def _miss(wrench: Array, place: Array) -> Array:
    """From a place (3,) to the nearest point of a wrench's line of force."""
    force, moment = wrench[:3], wrench[3:] - np.cross(place, wrench[:3])
    return np.cross(force, moment) / float(force @ force)
