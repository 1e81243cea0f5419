# SPDX-License-Identifier: Apache-2.0
"""Samples of a recording, in the robot's order, before any sign, bias or frame is applied."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Samples:
    """N samples of a robot with n joints and k force-torque sensors.

    Values are those of the log times the unit factors of the description's `log` key; sign, gain,
    bias, polarity and frame of the description are not applied yet. NaN = not measured at this
    instant; the axes that a sensor lacks are NaN.

    Attributes:
        time: (N,) [s], as logged: stamps may repeat or go back.
        q: (N, n) [rad] or [m].
        qd: (N, n) [rad/s] or [m/s].
        tau: (N, n) joint torques in logged units.
        wrench: (N, k, 6) `fx fy fz mx my mz` of each sensor in its logged frame [N, Nm].
        row: number of the first row in the log, counted from 0, for messages.
    """

    time: np.ndarray
    q: np.ndarray
    qd: np.ndarray
    tau: np.ndarray
    wrench: np.ndarray
    row: int = 0

    def __len__(self) -> int:
        return len(self.time)

    def where(self, keep: np.ndarray | slice) -> "Samples":
        """Some of the samples; `row` stays that of the first of all."""
        q, qd, tau, wrench = self.q[keep], self.qd[keep], self.tau[keep], self.wrench[keep]
        return Samples(self.time[keep], q, qd, tau, wrench, self.row)
