# SPDX-License-Identifier: Apache-2.0
"""A pose or a motion about it, with a smooth way from one to the other."""

import numpy as np

from touchline.arrays import Array
from touchline.simulation.control import Setpoint, Trajectory

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
        self._away, self._resumed = np.zeros_like(pose), -np.inf

    def resume(self, q: Array, time: float) -> None:
        """Eases back to the trajectory from where the arm stands, `q` (n,) at `time` [s]."""
        self._away = np.zeros_like(q)
        self._away, self._resumed = q - self(time).q, time

    def lead(self, step: Array) -> None:
        """Moves the pose at which it stands by (n,) [rad or m]."""
        self._pose = self._pose + step

    def __call__(self, time: float) -> Setpoint:
        """The setpoint at a time [s]; times do not go back."""
        if time >= self._began + EASE and self._to != float(self.wanted):
            self._from, self._to, self._began = self._to, float(self.wanted), time
        way = self._to - self._from
        s, ds, dds = (way * part for part in eased(time - self._began))
        s += self._from
        back, dback, ddback = eased(time - self._resumed)
        goal = self._moving(time)
        away = goal.q - self._pose
        return Setpoint(
            self._pose + s * away + (1.0 - back) * self._away,
            s * goal.qd + ds * away - dback * self._away,
            s * goal.qdd + 2 * ds * goal.qd + dds * away - ddback * self._away,
        )


def eased(time: float) -> tuple[float, float, float]:
    """From 0 to 1 within EASE, and the derivatives: a polynomial of degree five."""
    x = min(time / EASE, 1.0)
    return (
        x**3 * (10 - 15 * x + 6 * x**2),
        30 * x**2 * (1 - x) ** 2 / EASE,
        60 * x * (1 - x) * (1 - 2 * x) / EASE**2,
    )
