# SPDX-License-Identifier: Apache-2.0
"""A Franka arm, with a stand-in for the library's robot object."""

import time
from types import SimpleNamespace

import numpy as np
import pytest
from live_arms import make_arm

from touchline.errors import InputError
from touchline.live.adapters import from_franka
from touchline.live.connection import Connection
from touchline.live.franka import FrankaArm
from touchline.live.sample import Sample
from touchline.live.source import Address, LinkLost
from touchline.live.sources import connect, make_source


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return make_arm(tmp_path_factory.mktemp("franka"), 7, sensor=False)


class NetworkException(Exception):
    pass


class Panda:
    """A robot object: each state comes at its millisecond, or from a queue behind a pause."""

    def __init__(self):
        self.begin, self.tick, self.fails, self.queue = time.monotonic(), 1000, False, []

    @property
    def state(self):
        if self.fails:
            raise NetworkException("libfranka: UDP receive: Timeout\nmore")
        if self.queue:
            return make_state(self.queue.pop(0))
        time.sleep(0.001)
        self.tick = 1000 + int((time.monotonic() - self.begin) * 1e3)
        return make_state(self.tick)


def make_state(tick):
    clock = SimpleNamespace(to_sec=lambda: tick / 1e3)
    return SimpleNamespace(time=clock, q=[0.1] * 7, dq=[0.0] * 7, tau_J=[float(tick)] * 7)


def source(arm, make):
    return FrankaArm(Address("franka://host", "franka", "host"), arm, make)


def read_some(link, seconds):
    found, end = [], time.monotonic() + seconds
    while time.monotonic() < end:
        found += link.read()
    return found


def test_states_become_samples_and_lost_ticks_are_counted_by_the_arms_clock(arm):
    link = Connection(source(arm, lambda host: Panda()))
    link.open()
    found = read_some(link, 0.3)
    assert len(found) > 5
    numbers = [s.sequence for s in found]
    assert numbers == [round(1e3 * s.time) for s in found] and sorted(set(numbers)) == numbers
    assert found[-1].tau[3] == numbers[-1]
    assert link.streams[0].lost == numbers[-1] - numbers[0] + 1 - len(link_count(link))


def link_count(link):
    return range(link.streams[0].received)


def test_old_states_behind_a_pause_are_left_out(arm):
    panda = source(arm, lambda host: Panda())
    (note,) = panda.open()
    assert "sets the arm's collision thresholds" in note

    def fresh(tick, now):
        sample = from_franka(arm, make_state(tick))
        found = panda._is_fresh(sample, now)
        panda._last = sample.time
        return found

    assert [fresh(i, i / 1e3) for i in range(1000, 1005)] == [False, False, True, True, True]
    queued = [fresh(1005 + i, 1.160 + 2e-5 * i) for i in range(150)]  # 156 ms later, all at once
    assert not any(queued)
    assert [fresh(1160 + i, 1.1635 + i / 1e3) for i in range(3)] == [False, False, True]
    assert fresh(1200, 1.2045)  # a gap that is no longer than that of its clock


def test_after_a_fault_of_the_network_a_new_robot_object_is_made(arm):
    made = []

    def make(host):
        made.append(Panda())
        return made[-1]

    link = Connection(source(arm, make))
    link.open()
    made[0].fails = True
    found = read_some(link, 0.5)
    assert len(made) == 2 and found and link.usable
    notices = list(link.notices)
    assert any("UDP receive: Timeout; trying again" in n.text for n in notices)


def test_a_robot_that_is_not_there_and_one_that_is_none(arm, sara, tmp_path):
    def absent(host):
        raise NetworkException("no route")

    def refused(host):
        raise ValueError("incompatible version")

    with pytest.raises(LinkLost, match="host: no route"):
        source(arm, absent).open()
    with pytest.raises(InputError, match="incompatible version"):
        source(arm, refused).open()
    with pytest.raises(InputError, match="use ros2:// for both"):
        make_source("franka://host", sara)
    with pytest.raises(InputError, match="7 joints"):
        make_source("franka://host", make_arm(tmp_path, 6))


def test_the_library_is_named_where_it_is_missing(arm, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "franky", None)
    with pytest.raises(InputError, match=r"pip install 'touchline\[franka\]'"):
        connect("franka://host", arm)


def test_a_real_library_says_in_one_line_that_nobody_answers(arm):
    pytest.importorskip("franky", reason="franky-control is not installed")
    with pytest.raises(InputError) as caught:
        connect("franka://127.0.0.1", arm)
    assert len(caught.value.problems) == 1 and "\n" not in str(caught.value)


def test_a_state_becomes_a_sample_in_one_line(arm):
    state = make_state(1234)
    for clock in (state.time, SimpleNamespace(toSec=lambda: 1.234), 1.234):
        state.time = clock
        sample = from_franka(arm, state)
        assert isinstance(sample, Sample) and sample.sequence == 1234
        assert np.array_equal(sample.tau, [1234.0] * 7)
    with pytest.raises(ValueError, match="q has 2 values"):
        from_franka(arm, SimpleNamespace(time=1.0, q=[1, 2], dq=[0] * 7, tau_J=[0] * 7))
