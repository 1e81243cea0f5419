# SPDX-License-Identifier: Apache-2.0
"""A pose or a motion about it, with a smooth way from one to the other."""

import numpy as np
from numpy.typing import NDArray

from touchline.simulation.control import Setpoint, Trajectory

Array = NDArray[np.float64]

EASE = 2.0  # s from standing to moving, and back


class Switched:
    """A trajectory of which the simulation takes a share between 0, standing, and 1, moving.

    Args:
        pose: (n,) at which it stands [rad or m].
        moving: the motion about it.
    """

    def __init__(self, pose: Array, moving: Trajectory) -> None:
        self._pose, self._moving = pose, moving
        self.wanted = False
        self._from, self._to, self._began = 0.0, 0.0, -np.inf

    def __call__(self, time: float) -> Setpoint:
        """The setpoint at a time [s]; times do not go back."""
        if time >= self._began + EASE and self._to != float(self.wanted):
            self._from, self._to, self._began = self._to, float(self.wanted), time
        s, ds, dds = self._share(time)
        goal = self._moving(time)
        away = goal.q - self._pose
        return Setpoint(
            self._pose + s * away,
            s * goal.qd + ds * away,
            s * goal.qdd + 2 * ds * goal.qd + dds * away,
        )

    def _share(self, time: float) -> tuple[float, float, float]:
        """The share and its derivatives, a polynomial of degree five."""
        x = min((time - self._began) / EASE, 1.0)
        way = self._to - self._from
        return (
            self._from + way * x**3 * (10 - 15 * x + 6 * x**2),
            way * 30 * x**2 * (1 - x) ** 2 / EASE,
            way * 60 * x * (1 - x) * (1 - 2 * x) / EASE**2,
        )
