# SPDX-License-Identifier: Apache-2.0
"""Which link a pull presses, and where."""

import numpy as np
import pytest

from touchline.localizer.skin import Crossing
from touchline.view.reach import pressed

NOWHERE = np.zeros(3)


def solids(*spans):
    """Crossings of a line with solids (link, where it goes in, where out), in any order."""
    ends = [(link, at, i == 0) for link, *two in spans for i, at in enumerate(two)]
    return [Crossing(link, at, NOWHERE, NOWHERE, entry) for link, at, entry in ends]


@pytest.mark.parametrize(
    ("spans", "expected"),
    [
        ([("a", -0.05, 0.04)], ("a", 0.05)),
        ([("a", -0.05, 0.04), ("b", -0.2, -0.1)], ("a", 0.05)),
        ([("a", -0.05, 0.04), ("b", -0.2, -0.055)], ("b", 0.2)),
        ([("a", -0.05, 0.04), ("b", -0.2, -0.02)], ("b", 0.2)),
        ([("a", -0.05, 0.04), ("b", -0.2, -0.055), ("c", -0.3, -0.205)], ("c", 0.3)),
        ([("a", -0.05, 0.04), ("b", 0.02, 0.1)], ("a", 0.05)),
        ([("a", -0.05, 0.04), ("b", -0.07, -0.055)], ("a", 0.05)),
        ([("b", -0.2, -0.055)], None),
        ([("a", 0.1, 0.2)], None),
        ([], None),
    ],
)
def test_a_finger_presses_the_outermost_of_links_that_leave_it_no_room(spans, expected):
    assert pressed(solids(*spans), "a") == expected
