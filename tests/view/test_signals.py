# SPDX-License-Identifier: Apache-2.0
"""Curves and time line of a replay, as the page gets them."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchline.figure import X, Y, Z
from touchline.view.replay import Replay
from touchline.view.signals import (
    JOINTS,
    Box,
    colour_of,
    force_on,
    gaps,
    nice_range,
    signal_groups,
    window_around,
    with_now,
)
from touchline.view.timeline import THICK, areas


def test_every_signal_can_be_chosen(touched):
    replay = Replay(touched.out)
    groups = signal_groups(replay.robot, replay.signals)
    shown = {column for group in groups.values() for column in group.columns}
    assert shown == set(replay.signals)
    assert groups[force_on("wrist")].columns == ("wrist.seg.fx", "wrist.seg.fy", "wrist.seg.fz")
    assert len(groups[JOINTS].columns) == 7


def test_a_robot_without_wrench_sensors_has_its_torques():
    signals = ("tau_ext.a", "tau_ext.b")
    robot = SimpleNamespace(segment_names=("root",), sensor_names=(), joint_names=("a", "b"))
    assert list(signal_groups(robot, signals))[0] == JOINTS


def test_the_window_stays_in_the_recording(touched):
    replay = Replay(touched.out)
    assert window_around(replay, 1.0, None) == (replay.start, replay.end)
    assert window_around(replay, replay.start, 1.0) == pytest.approx((0.0, 1.0))
    assert window_around(replay, replay.end, 1.0)[1] == pytest.approx(replay.end)
    begin, end = window_around(replay, 1.3, 1.0)
    assert begin < 1.3 < end and end - begin == pytest.approx(1.0)


def test_a_gap_is_where_no_curve_has_a_value_for_long():
    times = np.arange(12.0)
    values = np.zeros((2, 12))
    values[0, 3:] = np.nan
    values[1, [1, 4, 5, 6, 7, 9, 10]] = np.nan
    assert np.flatnonzero(gaps(times, values, 2.0)).tolist() == [4, 5, 6, 7]
    assert np.flatnonzero(gaps(times, values, 0.5)).tolist() == [4, 5, 6, 7, 9, 10]
    values[:, 8:] = np.nan
    assert np.flatnonzero(gaps(times, values, 2.0)).tolist() == list(range(4, 12))


@settings(max_examples=40, deadline=None)
@given(st.integers(2, 60), st.floats(-1, 11), st.integers(0, 99))
def test_the_line_of_now_stands_at_now(count, now, seed):
    rng = np.random.default_rng(seed)
    times = np.sort(rng.uniform(0, 10, count))
    values = rng.normal(size=(2, count))
    x, a, b, line = with_now(times, values, now, Box(0.0, 10.0, -3.0, 3.0))
    assert (np.diff(x) >= 0).all() and set(line) == {-3.0, 3.0}
    assert x[line == 3.0].tolist() == [now]
    at = int(np.searchsorted(times, now))
    for row, own in ((a, values[0]), (b, values[1])):
        np.testing.assert_array_equal(np.delete(row, range(at, at + 3)), own)


def test_a_missing_value_is_the_one_before():
    values = np.array([[np.nan, 1.0, np.nan, np.nan, 2.0]])
    _, row, _ = with_now(np.arange(5.0), values, 9.0, Box(0.0, 5.0, 0.0, 2.0))
    assert row.tolist() == [0.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0]


@settings(max_examples=60, deadline=None)
@given(st.lists(st.floats(-1e4, 1e4), max_size=20))
def test_the_range_holds_zero_and_all_values_and_rarely_changes(values):
    values = np.array([*values, np.nan])
    low, high = nice_range(values, None)
    inside = values[np.isfinite(values)]
    assert low < 0 < high and (inside >= low).all() and (inside <= high).all()
    assert nice_range(0.9 * values, (low, high)) == (low, high) or np.ptp([*inside, 0.0]) < 1.0


def test_bars_are_areas_where_events_last():
    x, heights = areas(
        [(0, [(1.0, 2.0), (5.0, 6.0)]), (0, [(3.0, 4.0)]), (1, [(1.5, 5.5)])], (0.0, 9.0)
    )
    assert (np.diff(x) >= 0).all() and heights.shape == (3, len(x))

    def inside(row, time):
        """Whether the area covers a time between two points."""
        after = np.searchsorted(x, time)
        pair = heights[row, after - 1 : after + 1]
        assert pair[0] == pair[1]
        return bool(pair[0] > np.floor(pair[0] + 0.5))

    assert [inside(0, t) for t in (1.2, 2.5, 3.5, 5.2, 5.7)] == [True, False, False, True, True]
    assert [inside(1, t) for t in (1.2, 2.5, 3.5, 5.2)] == [False, False, True, False]
    assert heights[2].min() == 1 - THICK and heights[2].max() == 1 + THICK


def test_bars_of_no_events():
    x, heights = areas([(0, []), (0, [])], (0.0, 9.0))
    assert x.tolist() == [0.0, 0.0, 9.0, 9.0] and (heights == -THICK).all()


def test_curves_of_x_y_and_z_have_the_colours_of_the_axes():
    names = ("fx", "my", "fz", "joint1", "joint2")
    colours = [colour_of(name, number) for number, name in enumerate(names)]
    assert colours[:3] == [X, Y, Z] and len(set(colours)) == 5
