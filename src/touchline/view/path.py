# SPDX-License-Identifier: Apache-2.0
"""A path through taught postures, followed to and fro at a speed that may change."""

import numpy as np

from touchline.arrays import Array
from touchline.simulation.control import Setpoint

LEAST = 0.02  # rad; a posture nearer to the last one is the same


class TaughtPath:
    """From posture to posture, at rest in each.

    Args:
        home: (n,) the first posture [rad or m].

    Attributes:
        points: the postures (n,).
        speed: of the quickest joint on the way [rad/s or m/s]; holds from the next posture on.
    """

    def __init__(self, home: Array) -> None:
        self.points = [np.array(home, float)]
        self.speed = 0.3
        self._from = self._to = 0
        self._step = 1
        self._began, self._lasts = 0.0, 0.0

    def add(self, q: Array) -> bool:
        """Teaches a posture; whether it is a new one."""
        if float(np.abs(self.points[-1] - q).max()) < LEAST:
            return False
        self.points.append(np.array(q, float))
        return True

    def __call__(self, time: float) -> Setpoint:
        """The setpoint at a time [s]; times do not go back."""
        if time >= self._began + self._lasts:
            self._next(time)
        start, way = self.points[self._from], self.points[self._to] - self.points[self._from]
        x = min((time - self._began) / self._lasts, 1.0)
        s = x**3 * (10 - 15 * x + 6 * x**2)
        ds = 30 * x**2 * (1 - x) ** 2 / self._lasts
        dds = 60 * x * (1 - x) * (1 - 2 * x) / self._lasts**2
        return Setpoint(start + s * way, ds * way, dds * way)

    def _next(self, time: float) -> None:
        self._from = self._to
        if not 0 <= self._from + self._step < len(self.points):
            self._step = -self._step
        if 0 <= self._from + self._step < len(self.points):
            self._to = self._from + self._step
        way = float(np.abs(self.points[self._to] - self.points[self._from]).max())
        self._began = time
        self._lasts = max(1.875 * way / max(self.speed, 1e-3), 0.5)  # 1.875: of the polynomial
