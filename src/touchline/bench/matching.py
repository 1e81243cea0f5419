# SPDX-License-Identifier: Apache-2.0
"""One event to one touch: which event is which touch, and what is left over on both sides."""

import numpy as np

from touchline.arrays import Array

MARGIN = 0.1  # s; a glove and an arm do not feel a touch at the same instant


def match(touches: Array, events: Array, margin: float = MARGIN) -> list[tuple[int, int]]:
    """Pairs of touch and event, as many as there can be, and of these the longest overlaps.

    An event that covers several touches is one of them; the others are missed.

    Args:
        touches: (T, 2) begin and end [s].
        events: (E, 2) begin and end [s]; infinite where an event has not ended.
        margin: by which a touch may be longer on both sides [s].

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
    whole = float(np.where(allowed, overlap, 0.0).sum()) + 1.0  # one pair more outweighs all
    rows, columns = linear_sum_assignment(np.where(allowed, whole + overlap, 0.0), maximize=True)
    return [(int(t), int(e)) for t, e in zip(rows, columns, strict=True) if allowed[t, e]]
