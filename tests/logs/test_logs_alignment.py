# SPDX-License-Identifier: Apache-2.0
"""Interpolation, delays and estimated velocities."""

import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from logs_support import assert_same, describe, make_samples

from touchline.logs import open_log, read_log, write_table
from touchline.logs.align import _walk, find_bracket, typical_period
from touchline.logs.blocks import windows
from touchline.logs.velocity import (
    VelocityWindow,
    choose_window,
    estimate_velocity,
    position_noise,
)
from touchline.model.description import JointDescription, SensorDescription
from touchline.observer.samples import Samples

STEPS = st.lists(st.floats(0.0, 0.01), min_size=2, max_size=40)


def whole_range(stamps, instants):
    """The arguments that let every instant look everywhere."""
    count, n = len(instants), len(stamps)
    return np.zeros(count, int), np.zeros(count, int), np.full(count, n)


@given(STEPS, st.lists(st.floats(-0.01, 0.4), min_size=1, max_size=20))
def test_interpolation_is_that_of_numpy_on_increasing_stamps(steps, instants):
    stamps = np.cumsum(np.array(steps) + 1e-4)
    instants = np.array(instants)
    values = np.sin(50.0 * stamps)
    bracket = find_bracket(stamps, instants, *whole_range(stamps, instants), np.inf)
    found = bracket.interpolate(values)
    inside = (instants >= stamps[0]) & (instants <= stamps[-1])
    np.testing.assert_array_equal(np.isfinite(found), inside)
    expected = np.interp(instants, stamps, values)
    np.testing.assert_allclose(found[inside], expected[inside], atol=1e-9)


@given(STEPS, st.data())
def test_walk_finds_what_a_sorted_search_finds(steps, data):
    stamps = np.cumsum(steps)
    n = len(stamps)
    index = st.integers(0, n - 1)
    low, start, last = np.array(sorted(data.draw(st.tuples(index, index, index))))[:, None]
    high = last + 1
    instant = np.array([data.draw(st.sampled_from(list(stamps)) | st.floats(-0.1, 0.5))])
    walked = _walk(stamps, instant, start, low, high)
    searched = np.minimum(np.searchsorted(stamps, instant, side="right") - 1, high - 1)
    assert walked == np.maximum(searched, low - 1)


@given(st.permutations(range(12)), st.integers(0, 11))
def test_interpolation_survives_any_order_of_stamps(order, bad):
    stamps = np.array(order, dtype=float)
    stamps[bad] = np.nan
    instants = np.arange(-1.0, 12.0, 0.25)
    bracket = find_bracket(stamps, instants, *whole_range(stamps, instants), 3.0)
    found = bracket.interpolate(stamps)
    # The signal is the stamp itself: whatever neighbours were taken, nothing is extrapolated.
    good = np.isfinite(found)
    np.testing.assert_allclose(found[good], instants[good], atol=1e-12)


def test_no_value_far_from_samples():
    stamps = np.array([0.0, 1.0, 20.0, 21.0])
    instants = np.array([-0.1, 0.5, 3.9, 4.1, 16.9, 17.0, 21.0, 21.1])
    bracket = find_bracket(stamps, instants, *whole_range(stamps, instants), 3.0)
    found = np.isfinite(bracket.interpolate(stamps))
    assert found.tolist() == [False, True, True, False, False, True, True, False]


def test_not_a_number_stays_between_its_neighbours():
    stamps = np.arange(6.0)
    values = np.array([0.0, 1.0, np.nan, 3.0, 4.0, 5.0])
    instants = np.array([1.0, 1.5, 2.0, 2.5, 3.0, 3.5])
    bracket = find_bracket(stamps, instants, *whole_range(stamps, instants), 3.0)
    expected = [1.0, np.nan, np.nan, np.nan, 3.0, 3.5]
    np.testing.assert_array_equal(bracket.interpolate(values), expected)


def delayed_robot():
    joints = [JointDescription("j1", delay=0.0042), JointDescription("j2", delay=-0.0023)]
    return describe(joints, [SensorDescription("base", "link", delay=0.0031)])


def test_delays_are_undone(tmp_path):
    time = 5.0 + 1e-3 * np.arange(2000)
    signal = lambda t: np.sin(7.0 * t)  # noqa: E731
    columns = [signal(time - 0.0042), signal(time + 0.0023)]
    wrench = np.repeat(signal(time - 0.0031)[:, None, None], 6, axis=2)
    q = np.zeros((2000, 2))
    logged = Samples(time, q, q, np.stack(columns, axis=1), wrench)
    write_table(tmp_path / "log.parquet", logged, delayed_robot())
    samples = read_log(tmp_path / "log.parquet", delayed_robot())
    inner = slice(10, -10)
    np.testing.assert_array_equal(samples.time, time)
    # Linear interpolation of a sine: (w dt)^2 / 8.
    np.testing.assert_allclose(samples.tau[inner, 0], signal(time[inner]), atol=7e-6)
    np.testing.assert_allclose(samples.tau[inner, 1], signal(time[inner]), atol=7e-6)
    np.testing.assert_allclose(samples.wrench[inner, 0, 4], signal(time[inner]), atol=7e-6)
    assert np.isnan(samples.tau[-4:, 0]).all() and np.isfinite(samples.tau[:-5, 0]).all()
    assert np.isnan(samples.tau[:2, 1]).all() and np.isfinite(samples.tau[3:, 1]).all()


def messy_samples():
    """Jitter, repeats, disorder, a wrong stamp, a gap, a clock that starts again, and NaN."""
    rng = np.random.default_rng(3)
    samples = make_samples(3001)
    time = samples.time + rng.uniform(-2e-4, 2e-4, 3001)
    time[100] = time[99]
    time[200:203] = time[202:199:-1]
    time[900] = 1e9
    time[901] = np.nan
    time[1200:] += 5.0
    time[2000:] -= 500.0
    samples.q[300, 0] = np.nan
    samples.tau[400] = np.nan
    samples.wrench[500, 0, 2] = np.inf
    return dataclasses.replace(samples, time=time)


@pytest.mark.parametrize("robot", [delayed_robot(), describe()], ids=["delayed", "prompt"])
@pytest.mark.parametrize("rows", [1, 17, 1000, 65536])
def test_numbers_do_not_depend_on_chunks(tmp_path, rows, robot):
    messy = messy_samples()
    path = tmp_path / "log.parquet"
    without = {f"qd.{joint.name}": None for joint in robot.joints}
    write_without(path, messy, robot, without)
    whole = read_log(path, robot)
    with open_log(path, robot) as log:
        chunks = list(log.chunks(rows))
    assert [chunk.row for chunk in chunks] == list(range(0, 3001, rows))
    names = ("time", "q", "qd", "tau", "wrench")
    joined = {n: np.concatenate([getattr(c, n) for c in chunks]) for n in names}
    assert_same(Samples(**joined), whole)
    assert np.isfinite(whole.qd).mean() > 0.99
    assert np.isfinite(whole.tau).mean() > 0.98


def write_without(path, samples, robot, columns):
    import pyarrow.parquet as pq

    write_table(path, samples, robot)
    pq.write_table(pq.read_table(path).drop_columns(list(columns)), path)


def test_velocity_of_a_parabola_is_exact_on_uneven_stamps():
    rng = np.random.default_rng(1)
    t = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 200))
    t[50] = t[49]
    q = np.stack([3.0 * t**2 - t + 2.0, 1e3 + 5.0 * t], axis=1)
    for half in (1, 2, 7):
        qd = estimate_velocity(t, q, slice(0, 200), VelocityWindow(half, 1e-3))
        good = np.abs(np.arange(200) - 49.5) > half + 1
        np.testing.assert_allclose(qd[good, 0], 6.0 * t[good] - 1.0, atol=1e-8)
        np.testing.assert_allclose(qd[good, 1], 5.0, atol=1e-6)
        assert np.isfinite(qd).all()
        np.testing.assert_allclose(qd[49:51, 0], 6.0 * t[49] - 1.0, atol=0.02)


def test_velocity_has_no_delay():
    t = 1e-3 * np.arange(3000)
    w = 2.0 * np.pi * 3.0
    qd = estimate_velocity(t, np.sin(w * t)[:, None], slice(0, 3000), VelocityWindow(5, 1e-3))
    inner = slice(500, 2500)  # whole periods
    truth = w * np.cos(w * t)
    lag = np.sum(qd[inner, 0] * np.sin(w * t[inner])) / np.sum(qd[inner, 0] * np.cos(w * t[inner]))
    assert abs(lag / w) < 1e-6  # seconds
    np.testing.assert_allclose(qd[inner, 0], truth[inner], atol=2e-3 * w)


def test_velocity_of_missing_positions():
    t, q = 1e-3 * np.arange(20), np.linspace(0.0, 1.9, 20)[:, None].repeat(2, axis=1)
    q[8:13, 0] = np.nan
    qd = estimate_velocity(t, q, slice(0, 20), VelocityWindow(2, 1e-3))
    # Rows 9 to 11 see no two positions, rows 8 and 12 a straight line.
    assert np.isnan(qd[9:12, 0]).all()
    np.testing.assert_allclose(np.delete(qd[:, 0], [9, 10, 11]), 100.0, rtol=1e-9)
    np.testing.assert_allclose(qd[:, 1], 100.0, rtol=1e-9)


def test_window_follows_noise_and_bandwidth():
    one = np.ones(1)
    quiet = choose_window(1e-9 * one, 1e-3 * one, 10.0 * one, 1e-3)
    some = choose_window(1e-4 * one, 1e-3 * one, 10.0 * one, 1e-3)
    loud = choose_window(1e-3 * one, 1e-3 * one, 10.0 * one, 1e-3)
    fast = choose_window(1e-3 * one, 1e-3 * one, 200.0 * one, 1e-3)
    assert quiet.half == 1 and some.half == 25
    assert loud.half == 50 and fast.half == 2
    rng = np.random.default_rng(0)
    q = np.sin(np.arange(4000) * 1e-3)[:, None] + 1e-4 * rng.normal(size=(4000, 1))
    assert position_noise(q)[0] == pytest.approx(1e-4, rel=0.05)


def test_velocity_noise_is_as_stated():
    rng, h = np.random.default_rng(0), 4
    q = 1e-5 * rng.normal(size=(20000, 1))
    t = 1e-3 * np.arange(20000)
    qd = estimate_velocity(t, q, slice(0, 20000), VelocityWindow(h, 1e-3))
    expected = 1e-5 / 1e-3 * np.sqrt(3.0 / (h * (h + 1) * (2 * h + 1)))
    assert np.std(qd) == pytest.approx(expected, rel=0.02)


@given(st.lists(st.integers(0, 9), max_size=12), st.integers(1, 12), st.integers(0, 9))
def test_windows_cover_every_row_once_with_its_neighbours(sizes, rows, halo):
    total = sum(sizes)
    edges = np.cumsum([0, *sizes])
    blocks = ({"x": np.arange(a, b)} for a, b in zip(edges, edges[1:], strict=False))
    seen = []
    for window in windows(blocks, rows, halo):
        x = window.padded["x"]
        core = x[window.start : window.stop]
        assert core[0] == window.row
        assert len(core) == rows or core[-1] == total - 1
        first, last = max(core[0] - halo, 0), min(core[-1] + halo, total - 1)
        assert x.tolist() == list(range(first, last + 1))
        seen.extend(core)
    assert seen == list(range(total))


def test_typical_period_ignores_repeats_and_steps_back():
    assert typical_period(np.array([0.0, 0.0, 1.0, 2.0, 1.5, 2.5, np.nan, 9.0])) == 1.0
    assert np.isnan(typical_period(np.array([1.0, 1.0])))
