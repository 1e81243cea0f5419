# SPDX-License-Identifier: Apache-2.0
"""States of streams, on a clock of the test's own."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchline.live.sample import on_nanoseconds, stamp, whole_nanoseconds
from touchline.live.streams import Stream, StreamState


def fed(count=100, period=0.001, **options):
    stream = Stream("joints", period)
    for i in range(count):
        stream.receive(i * period, 10.0 + i * period, **options)
    return stream, 10.0 + (count - 1) * period


def test_a_stream_is_not_received_until_something_comes():
    stream = Stream("joints")
    assert stream.state(0.0) is StreamState.NOT_RECEIVED
    assert stream.age(0.0) == math.inf and stream.rate == 0.0
    stream.receive(0.0, 1.0)
    assert stream.state(1.0) is StreamState.OK


@pytest.mark.parametrize("period", [0.001, 0.002, 0.004])
def test_silence_is_told_within_20_ms(period):
    stream, now = fed(period=period)
    assert stream.state(now + 2.0 * period) is StreamState.OK
    assert stream.patience <= 0.016
    assert stream.state(now + 0.016) is StreamState.STALE


def test_what_is_no_number_is_invalid():
    stream, now = fed(valid=False)
    assert stream.state(now) is StreamState.INVALID


def test_samples_that_come_late_are_slow_and_a_prompt_one_is_not():
    stream, now = fed()
    stream.receive(0.1, now + 0.021)
    assert stream.state(now + 0.021) is StreamState.SLOW
    assert stream.lag == pytest.approx(0.020, abs=1e-4)
    for i in range(80):
        stream.receive(0.121 + 0.001 * i, now + 0.022 + 0.001 * i)
    assert stream.state(now + 0.101) is StreamState.OK


def test_half_the_rate_is_slow():
    stream = Stream("joints", 0.001)
    for i in range(100):
        stream.receive(0.002 * i, 0.002 * i)
    assert stream.state(0.2) is StreamState.SLOW
    assert stream.rate == pytest.approx(500.0)


def test_a_share_of_lost_samples_is_slow():
    stream = Stream("joints", 0.001)
    for i in range(100):
        stream.receive(0.001 * i, 0.001 * i, lost=int(i % 10 == 0))
    assert stream.lost == 10 and stream.state(0.1) is StreamState.SLOW


def test_a_clock_that_is_set_back_is_no_lag():
    stream, now = fed()
    stream.receive(-5000.0, now + 0.001)
    assert stream.state(now + 0.001) is StreamState.OK


@given(st.integers(-(2**31) * 10**9, 2**31 * 10**9 - 1))
def test_whole_nanoseconds_survive(nanoseconds):
    assert abs(whole_nanoseconds(stamp(nanoseconds)) - nanoseconds) <= 300  # of a date's float64
    once = on_nanoseconds(stamp(nanoseconds))
    assert on_nanoseconds(once) == once


@given(st.floats(0.0, 1e6))
def test_times_of_robots_are_kept_to_half_a_nanosecond(time):
    assert abs(on_nanoseconds(time) - time) <= 0.6e-9


def test_samples_that_come_at_once_have_the_rate_of_their_stamps():
    stream = Stream("joints")
    for i in range(64):
        stream.receive(0.002 * i, 5.0)
    assert stream.rate == pytest.approx(500.0)
