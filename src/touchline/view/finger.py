# SPDX-License-Identifier: Apache-2.0
"""A finger on the simulated arm, led by a visitor's mouse over the surface."""

from collections import deque

import numpy as np

from touchline.arrays import Array
from touchline.simulation.hands import Hand

SPEED = 0.12  # m/s; a mouse jumps, a finger does not
FRICTION = 0.3  # by which it drags the surface along
SHORTEST = 0.25  # s of a press
NEAR = 1e-4  # m


class Finger:
    """Presses, slides to where it is led, and lifts once it has been everywhere.

    Args:
        link: that it touches.
        point: (3,) [m] in the link's frame.
        normal: (3,) outward there.
        force: [N].

    Attributes:
        hand: what it does to the arm.
        leaving: whether it lifts once it has been everywhere.
    """

    def __init__(self, link: str, point: Array, normal: Array, force: float) -> None:
        self.hand = Hand(link, point.copy(), -force * normal)
        self.leaving = False
        self._normal, self._force = normal, force
        self._goals: deque[tuple[Array, Array]] = deque()
        self._pressed = 0.0

    def lead(self, point: Array, normal: Array) -> None:
        """Where it is to go next, (3,) and (3,) in the link's frame."""
        self._goals.append((point, normal))

    def step(self, seconds: float) -> None:
        """So many seconds pass."""
        self._pressed += seconds
        left, drag = SPEED * seconds, np.zeros(3)
        while left > 0.0 and self._goals:
            point, normal = self._goals[0]
            way = point - self.hand.grip
            far = float(np.linalg.norm(way))
            if far <= max(left, NEAR):
                self.hand.grip, self._normal = point.copy(), normal
                self._goals.popleft()
                left -= far
                continue
            drag = way / far
            self.hand.grip = self.hand.grip + left * drag
            self._normal = self._normal + (normal - self._normal) * min(1.0, left / far)
            left = 0.0
        outward = self._normal / np.linalg.norm(self._normal)
        self.hand.force = self._force * (FRICTION * drag - outward)
        if self.leaving and not self._goals and self._pressed >= SHORTEST:
            self.hand.released = True
