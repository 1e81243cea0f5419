# SPDX-License-Identifier: Apache-2.0
"""One event to one touch: which event is which touch, and what is left over on both sides."""

import numpy as np

from touchline.arrays import Array, Mask

MARGIN = 0.1  # s; a glove and an arm do not feel a touch at the same instant
LITTLE = 1e-6  # s of overlap; more than rounding, less than any sample


def match(
    touches: Array, events: Array, margin: float = MARGIN, alike: Mask | None = None
) -> list[tuple[int, int]]:
    """Pairs of touch and event, as many as there can be, and of these the longest overlaps.

    An event that covers several touches is one of them; the others are missed.

    Args:
        touches: (T, 2) begin and end [s].
        events: (E, 2) begin and end [s]; infinite where an event has not ended.
        margin: by which a touch may be longer on both sides [s].
        alike: (T, E) whether both are on one body; of equal overlaps such a pair is preferred.

    Returns:
        Numbers of touch and event, in the order of the touches.
    """
    from scipy.optimize import linear_sum_assignment

    if not len(touches) or not len(events):
        return []
    begin = np.maximum(touches[:, None, 0] - margin, events[None, :, 0])
    end = np.minimum(touches[:, None, 1] + margin, events[None, :, 1])
    overlap = end - begin
    allowed = overlap >= 0.0
    if alike is not None:
        overlap = overlap + LITTLE * alike
    whole = float(np.where(allowed, overlap, 0.0).sum()) + 1.0  # one pair more outweighs all
    rows, columns = linear_sum_assignment(np.where(allowed, whole + overlap, 0.0), maximize=True)
    return [(int(t), int(e)) for t, e in zip(rows, columns, strict=True) if allowed[t, e]]
