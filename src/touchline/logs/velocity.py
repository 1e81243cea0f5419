# SPDX-License-Identifier: Apache-2.0
"""Joint velocities from positions, without delay, for logs that lack them.

Each velocity is the slope at its own instant of a parabola fitted to the positions around it, on
the actual time stamps (for even steps the filter of Savitzky and Golay, Anal. Chem. 36, 1964).
"""

import math
from dataclasses import dataclass

import numpy as np

# A sinusoid of angular frequency w loses about (w T)^2 / 10 of its slope over a half window T;
# 0.5 / bandwidth keeps that loss at 2.5 % at the observer's corner.
_CORNER = 0.5
_MAX_HALF = 50
# Stamps that are this much farther away than the window's rows should be are not its own.
_STRETCH = 1.5


@dataclass(frozen=True)
class VelocityWindow:
    """How many rows on either side are fitted, and the log's period [s]."""

    half: int
    period: float

    @property
    def halo(self) -> int:
        """Rows on either side that a row's velocity may depend on."""
        return 2 * self.half

    @property
    def seconds(self) -> float:
        """Length of the whole window [s]."""
        return (2 * self.half + 1) * self.period

    @property
    def reach(self) -> float:
        """Rows farther than this from the instant do not count [s]."""
        return (self.half + 1) * self.period * _STRETCH


def position_noise(q: np.ndarray) -> np.ndarray:
    """(n,) standard deviation of white noise in (N, n) positions [rad].

    From third differences, which a smooth motion hardly reaches: their variance is 20 times that
    of the noise (binomial coefficients 1 3 3 1), and the median tells it from the odd jump.
    """
    if len(q) < 8:
        return np.zeros(q.shape[1])
    third = np.abs(np.diff(q, n=3, axis=0))
    third = np.where(np.isfinite(third), third, 0.0)
    return np.median(third, axis=0) / (0.6745 * math.sqrt(20.0))


def choose_window(
    noise_q: np.ndarray, noise_qd: np.ndarray, bandwidth: np.ndarray, period: float
) -> VelocityWindow:
    """The shortest window that brings the noise down, no longer than the bandwidth allows.

    Args:
        noise_q: (n,) standard deviation of the positions [rad].
        noise_qd: (n,) wanted standard deviation of the velocities [rad/s].
        bandwidth: (n,) of the observer [rad/s].
        period: of the log [s].

    The slope over 2 h + 1 even samples has the standard deviation
    `noise_q / period * sqrt(3 / (h (h + 1) (2 h + 1)))`.
    """
    half = 1
    longest = min(max(int(_CORNER / (np.max(bandwidth) * period)), 1), _MAX_HALF)
    while half < longest:
        gain = math.sqrt(3.0 / (half * (half + 1) * (2 * half + 1))) / period
        if np.all(noise_q * gain <= noise_qd):
            break
        half += 1
    return VelocityWindow(half, period)


def estimate_velocity(
    stamps: np.ndarray, q: np.ndarray, rows: slice, window: VelocityWindow
) -> np.ndarray:
    """Slopes of local parabolas.

    Args:
        stamps: (M,) of the rows and their neighbours [s].
        q: (M, n) positions; NaN takes no part.
        rows: the rows wanted.
        window: from `choose_window`; it must be the same for a whole log.

    Returns:
        (rows, n) velocities; a straight line where only two instants are known, NaN where one.
    """
    own = np.arange(rows.start, rows.stop)
    here = stamps[own]
    origin = np.where(np.isfinite(q[own]), q[own], 0.0)
    whole = bool(np.all(np.isfinite(q)))
    sums = _Sums((len(own), 1 if whole else q.shape[1]), (len(own), q.shape[1]))
    # Where the log begins and ends the window moves inward, so that a parabola still fits.
    middle = np.clip(own, window.half, max(len(stamps) - 1 - window.half, window.half))
    for offset in range(-window.half, window.half + 1):
        at = np.minimum(middle + offset, len(stamps) - 1)
        with np.errstate(invalid="ignore"):
            x = (stamps[at] - here) / window.reach
            use = (np.abs(x) <= 1.0) & (middle + offset == at)
        x = np.where(use, x, 0.0)[:, None]
        y = q[at] - origin
        if whole:
            sums.add(use[:, None].astype(float), x, y)
        else:
            known = np.isfinite(y) & use[:, None]
            sums.add(known.astype(float), x, np.where(known, y, 0.0))
    return sums.slope() / window.reach


class _Sums:
    """Moments of the samples in every row's window, about the row's own instant and position."""

    def __init__(self, shape: tuple[int, int], full: tuple[int, int]):
        self.x = [np.zeros(shape) for _ in range(5)]
        self.y = [np.zeros(full) for _ in range(3)]

    def add(self, weight: np.ndarray, x: np.ndarray, y: np.ndarray) -> None:
        """Add one sample to every window."""
        power = weight
        for order in range(5):
            self.x[order] += power
            if order < 3:
                self.y[order] += power * y
            power = power * x

    def slope(self) -> np.ndarray:
        """First-order coefficient of the least-squares parabola, by elimination of the others."""
        s0, s1, s2, s3, s4 = self.x
        y0, y1, y2 = self.y
        with np.errstate(divide="ignore", invalid="ignore"):
            # Central moments: what is left after the constant has been fitted.
            c11, c12, c22 = s2 - s1 * s1 / s0, s3 - s1 * s2 / s0, s4 - s2 * s2 / s0
            d1, d2 = y1 - s1 * y0 / s0, y2 - s2 * y0 / s0
            determinant = c11 * c22 - c12 * c12
            parabola = (d1 * c22 - d2 * c12) / determinant
            line = d1 / c11
        curved = (s0 > 2.5) & (determinant > 1e-9 * c11 * c22)
        return np.where(curved, parabola, np.where(c11 > 1e-12, line, np.nan))
