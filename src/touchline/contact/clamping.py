# SPDX-License-Identifier: Apache-2.0
"""Clamped or free: do forces on two sides oppose each other?

Between segments that is seen: two forces of comparable size in opposite directions. Within one
segment the wrench is only their sum; where it does not come from one force alone ("not separable"),
clamped or free is not known.
"""

import numpy as np
from numpy.typing import NDArray

from touchline.estimation.observer import Estimate

Array = NDArray[np.float64]

LEAST_TIME = 0.02  # s for which it must hold
LEAST_FORCE = 5.0  # N
RATIO, COSINE = 0.3, -0.5  # of the smaller to the larger force, of the angle between them


class Clamping:
    """Follows the samples of a pipeline; the same in whatever parts they come."""

    def __init__(self) -> None:
        self._since: dict[int, float] = {}

    def reset(self) -> None:
        """Nothing touches any more."""
        self._since = {}

    def follow(self, time: Array, estimate: Estimate, levels: NDArray) -> NDArray[np.bool_]:
        """Whether each segment is clamped (N, m), after N samples with `levels` (N, m)."""
        clamped = np.zeros(levels.shape, dtype=bool)
        active = levels > 0
        touched = np.flatnonzero(active.any(axis=1))
        if not len(touched):
            self._since = {}
            return clamped
        opposed = np.zeros(levels.shape, dtype=bool)
        forces = np.nan_to_num(estimate.segment_wrench[touched, :, :3])
        opposed[touched] = _opposed(forces, active[touched])
        for g in range(levels.shape[1]):
            clamped[:, g] = self._lasting(g, time, opposed[:, g])
        return clamped

    def _lasting(self, g: int, time: Array, opposed: NDArray) -> NDArray[np.bool_]:
        """Where `opposed` (N,) has held without a break for LEAST_TIME."""
        if not opposed.any():
            self._since.pop(g, None)
            return opposed
        rises = opposed & ~np.concatenate([[g in self._since], opposed[:-1]])
        begins = np.where(rises, time, -np.inf)
        begins[0] = max(begins[0], self._since.get(g, -np.inf))
        since = np.maximum.accumulate(begins)
        if opposed[-1]:
            self._since[g] = float(since[-1])
        else:
            self._since.pop(g, None)
        return opposed & (time - since >= LEAST_TIME)


def _opposed(forces: Array, active: NDArray) -> NDArray[np.bool_]:
    """Segments (T, m) whose force another segment's opposes."""
    sizes = np.linalg.norm(forces, axis=2)
    strong = active & (sizes > LEAST_FORCE)
    product = sizes[:, :, None] * sizes[:, None, :]
    against = forces @ np.swapaxes(forces, 1, 2) < COSINE * product
    comparable = np.minimum(sizes[:, :, None], sizes[:, None, :]) > RATIO * np.maximum(
        sizes[:, :, None], sizes[:, None, :]
    )
    both = strong[:, :, None] & strong[:, None, :]
    return (against & comparable & both).any(axis=2)
