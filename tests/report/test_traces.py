# SPDX-License-Identifier: Apache-2.0
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from touchline.report.traces import Traces


def made(time, values, buckets=64, width=0.01, cuts=()):
    traces = Traces(values.shape[1], buckets, width)
    for part in np.split(np.arange(len(time)), cuts):
        traces.add(time[part], values[part])
    return traces


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 3000), st.lists(st.integers(0, 3000), max_size=4), st.integers(0, 99))
def test_extremes_survive_and_parts_do_not_show(rows, cuts, seed):
    rng = np.random.default_rng(seed)
    time = 5.0 + np.cumsum(rng.uniform(0, 0.01, rows))
    values = rng.normal(size=(rows, 2))
    values[rng.random(rows) < 0.1, 0] = np.nan
    traces = made(time, values, cuts=sorted(min(c, rows) for c in cuts))
    whole = made(time, values)
    np.testing.assert_array_equal(traces.low, whole.low)
    assert np.nanmin(traces.low[:, 1]) == values[:, 1].min()
    assert np.nanmax(traces.high[:, 1]) == values[:, 1].max()
    assert traces.used <= 64 and traces.width * traces.used >= time[-1] - time[0] - traces.width


def test_every_sample_lies_in_its_piece():
    time = np.arange(10_000) * 1e-3
    values = np.sin(time * 7)[:, None]
    traces = made(time, values, buckets=128, width=1e-3)
    index = ((time - traces.start + 1e-6) / traces.width).astype(int)
    assert np.all(values[:, 0] >= traces.low[index, 0])
    assert np.all(values[:, 0] <= traces.high[index, 0])


def test_a_gap_stays_empty():
    time = np.concatenate([np.arange(10) * 0.01, 0.4 + np.arange(10) * 0.01])
    traces = made(time, np.ones((20, 1)))
    assert np.isnan(traces.low[15:35, 0]).all() and np.isfinite(traces.low[41, 0])


@pytest.mark.parametrize("stray", [1e9, -50.0, np.nan, np.inf])
def test_a_stray_stamp_does_not_spoil_the_axis(stray):
    time = np.arange(500) * 0.01
    time[200] = stray
    traces = made(time, np.ones((500, 1)), buckets=512)
    assert traces.start == 0.0 and traces.used == 500


def test_buckets_must_be_even():
    with pytest.raises(ValueError, match="7"):
        Traces(1, 7, 0.1)
