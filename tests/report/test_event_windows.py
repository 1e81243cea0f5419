# SPDX-License-Identifier: Apache-2.0
"""The curves around events keep their extremes, whatever the parts in which a recording comes."""

import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchline.report import event_windows
from touchline.report.event_windows import AFTER, BEFORE, EventWindows
from touchline.report.plots import STEPS, curve_path
from touchline.result.event import Event

PERIOD = 0.01


def streamed(time, values, events, cuts=()):
    """Windows of a recording in parts; an event is known from the part in which it begins."""
    windows = EventWindows({"base": range(values.shape[1])}, PERIOD)
    for part in np.split(np.arange(len(time)), cuts):
        known = [e for e in events if len(part) and e.detected <= time[part[-1]]]
        windows.add(time[part], values[part], known)
    return windows


@settings(max_examples=40, deadline=None)
@given(st.lists(st.integers(0, 2000), max_size=4), st.integers(0, 99))
def test_a_window_holds_the_extremes_around_its_event(cuts, seed):
    rng = np.random.default_rng(seed)
    time = 3.0 + PERIOD * np.arange(2000)
    values = rng.normal(size=(2000, 2))
    values[rng.random(2000) < 0.05, 0] = np.nan
    event = Event(
        id=0, segment="base", level="contact", detected=float(time[700]), cleared=float(time[900])
    )
    last = Event(id=1, segment="base", level="contact", detected=float(time[1900]))
    windows = streamed(time, values, [event, last], sorted(cuts))
    for found, end in ((event, event.cleared + AFTER), (last, time[-1])):
        window = windows.get(found)
        inside = values[(time >= found.detected - BEFORE) & (time <= end)]
        for column in range(2):
            low, high = window.of(column)
            assert np.fmin.reduce(low) == np.float32(np.nanmin(inside[:, column]))
            assert np.fmax.reduce(high) == np.float32(np.nanmax(inside[:, column]))
        assert window.start == pytest.approx(found.detected - BEFORE, abs=1.5 * PERIOD)
        coarse = window.coarser(16)
        assert len(coarse.low) <= 16 and np.nanmax(coarse.high) == np.nanmax(window.high)


def test_bad_stamps_do_not_spoil_a_window():
    time = PERIOD * np.arange(1000)
    time[400], time[405] = np.nan, 1e9
    event = Event(id=0, segment="base", level="contact", detected=3.5, cleared=5.0)
    window = streamed(time, np.ones((1000, 1)), [event], (300, 402)).get(event)
    assert window.start == pytest.approx(3.1) and len(window.low) <= 256
    assert np.nanmin(window.low) == np.nanmax(window.high) == 1.0


def test_memory_is_bounded(monkeypatch):
    monkeypatch.setattr(event_windows, "MOST_WINDOWS", 3)
    time = PERIOD * np.arange(1000)
    events = [
        Event(id=i, segment="base", level="contact", detected=0.5 + i, cleared=0.7 + i)
        for i in range(8)
    ]
    windows = streamed(time, np.ones((1000, 1)), events)
    assert [windows.get(e) is not None for e in events] == [True] * 3 + [False] * 5


def read_path(path, pieces, least, largest):
    """An independent reader: (P,) lowest and highest values of a path."""
    low, high = np.full(pieces, np.nan), np.full(pieces, np.nan)
    x = y = 0
    for command, a, b in re.findall(r"([Mlv])(-?\d+)(?: (-?\d+))?", path):
        if command == "M":
            x, y = int(a), int(b)
        elif command == "l":
            x, y = x + int(a), y + int(b)
        else:
            y += int(a)
        value = largest - y / STEPS * (largest - least)
        low[x], high[x] = np.fmin(low[x], value), np.fmax(high[x], value)
    return low, high


def gaps(low, join):
    """How many strokes there are, if so many empty pieces make none."""
    known = np.flatnonzero(np.isfinite(low))
    return len(known[:1]) + int((np.diff(known) > join + 1).sum())


@settings(max_examples=60, deadline=None)
@given(st.integers(1, 200), st.integers(0, 99))
def test_a_path_says_what_the_curve_was(pieces, seed):
    rng = np.random.default_rng(seed)
    low = rng.normal(size=pieces)
    high = low + np.where(rng.random(pieces) < 0.3, 0.0, rng.exponential(size=pieces))
    low[rng.random(pieces) < 0.2] = np.nan
    high[np.isnan(low)] = np.nan
    join = seed % 3
    path = curve_path(low, high, -9.0, 15.0, join)
    assert path.count("M") == gaps(low, join)
    found = read_path(path, pieces, -9.0, 15.0)
    step = 24.0 / STEPS
    np.testing.assert_allclose(found[0], low, atol=0.51 * step)
    np.testing.assert_allclose(found[1], high, atol=0.51 * step)
