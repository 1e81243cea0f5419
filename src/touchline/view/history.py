# SPDX-License-Identifier: Apache-2.0
"""The last seconds of the segments' wrenches, thin enough to be drawn many times a second."""

from collections import deque

import numpy as np

from touchline.arrays import Array

SECONDS = 10.0
ROWS_PER_SECOND = 25


class History:
    """Wrenches (m, 6) of some segments over the last SECONDS.

    Args:
        segments: names (m,) in whose order they are kept.
    """

    def __init__(self, segments: tuple[str, ...]) -> None:
        self.segments = segments
        self._rows: deque[tuple[float, Array]] = deque()
        self.clear()

    def clear(self) -> None:
        """Forgets all; time may begin anew."""
        self._rows.clear()
        self._next = -np.inf

    def add(self, time: Array, segments: tuple[str, ...], wrench: Array) -> None:
        """Takes samples: `time` (N,) [s], `wrench` (N, k, 6) of the k `segments` that are known."""
        index = [segments.index(name) if name in segments else -1 for name in self.segments]
        for row in range(len(time)):
            if time[row] >= self._next:
                self._next = time[row] + 1.0 / ROWS_PER_SECOND
                known = [wrench[row, i] if i >= 0 else np.full(6, np.nan) for i in index]
                self._rows.append((float(time[row]), np.array(known)))
        while self._rows and self._rows[0][0] < time[-1] - SECONDS:
            self._rows.popleft()

    def curves(self, segment: str, first: int) -> tuple[Array, ...]:
        """Time before now (R,) [s], then three components of a wrench, from `first` on (0 or 3)."""
        if not self._rows:
            return tuple(np.zeros(1) for _ in range(4))
        time = np.array([t for t, _ in self._rows])
        g = self.segments.index(segment)
        parts = np.array([w[g, first : first + 3] for _, w in self._rows])
        return (time - time[-1], *parts.T)
