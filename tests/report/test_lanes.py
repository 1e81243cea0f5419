# SPDX-License-Identifier: Apache-2.0
"""Bars of events that overlap in time."""

from touchline.report.lanes import lanes


def test_bars_that_overlap_have_lanes_of_their_own():
    bars = [
        ("base", 0.0, 9.0),
        ("base", 1.0, 2.0),
        ("wrist", 1.0, 3.0),
        ("base", 1.5, 4.0),
        ("base", 2.0, 3.0),  # where the second has ended
    ]
    assert lanes(bars) == [(0, 3), (1, 3), (0, 1), (2, 3), (1, 3)]
    assert lanes([("base", 0.0, 1.0), ("base", 1.0, 2.0)]) == [(0, 1), (0, 1)]
    assert lanes([]) == []
