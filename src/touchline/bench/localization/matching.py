# SPDX-License-Identifier: Apache-2.0
"""Which of the places that were named belongs to which of the true ones."""

from collections.abc import Sequence

import numpy as np

from touchline.arrays import Array


def distances(places: Array, named: Sequence[Array | None]) -> Array:
    """Distances (m, k) [m] of k named positions from m true places (m, 3); inf for None."""
    far = np.full((len(places), len(named)), np.inf)
    for k, position in enumerate(named):
        if position is not None:
            far[:, k] = np.linalg.norm(places - position, axis=1)
    return far


def match(apart: Array) -> list[int | None]:
    """The named place of each true one, so that the sum of the distances (m, k) [m] is least.

    Returns:
        (m,) columns of `apart`; None where there are too few.
    """
    from scipy.optimize import linear_sum_assignment  # slow to import

    mine: list[int | None] = [None] * len(apart)
    known = np.isfinite(apart)
    rows, columns = linear_sum_assignment(np.where(known, apart, 1e6))
    for row, column in zip(rows.tolist(), columns.tolist(), strict=True):
        if known[row, column]:
            mine[row] = column
    return mine
