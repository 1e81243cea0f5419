# SPDX-License-Identifier: Apache-2.0
"""A source that a process of its own reads, as ROS 2 and Franka arms are read."""

import ctypes
import os
import pickle
import signal
import socket
import threading
import time

import numpy as np
import pytest
from live_support import Watched, assert_same, watch

from touchline.errors import InputError
from touchline.live.aside import OPENED, SAMPLE, ReadAside, _frame, _numbers
from touchline.live.connection import Connection
from touchline.live.sample import Sample
from touchline.native import core


def aside(robot, address, period=1e-3):
    return ReadAside(address, robot, ("simulation",), period)


def test_a_recording_read_aside_gives_the_same_bits(sara, recorded):
    path, live = recorded[".parquet"]
    seen = watch(sara, ReadAside(f"replay://{path}?speed=0", sara, ("recording",)), duration=None)
    assert_same(seen, live)


def test_samples_that_come_with_the_answer_are_kept(sara, monkeypatch):
    """A reader that is quicker than we are: its first samples come in the same bytes."""
    ours, theirs = socket.socketpair()
    source = aside(sara, "sim://")
    monkeypatch.setattr(source, "_start", lambda: setattr(source, "_socket", ours))
    joints, sensors = len(sara.joint_names), len(sara.sensor_names)
    signals = np.zeros(joints), np.zeros(joints), np.zeros(joints), np.zeros((sensors, 6))
    samples = [Sample(k * 1e-3, *signals, 0.0, k, np.zeros(sensors)) for k in range(3)]
    frames = [_frame(OPENED, pickle.dumps(["note"]))]
    frames += [_frame(SAMPLE, _numbers(sample)) for sample in samples]
    theirs.sendall(b"".join(frames))
    assert source.open() == ["note"]
    assert [sample.sequence for sample in source.read(0.0)] == [0, 1, 2]
    theirs.close()


def test_a_stall_of_python_costs_no_sample_and_no_time(sara):
    hold = ctypes.PyDLL(None).usleep  # a call that keeps the interpreter's lock
    stalls, gaps = [], []

    def each(session):
        felt = session.connection.source._felt
        if felt is None or session.samples < 1300 or stalls:
            return
        before = felt.runner.taken
        felt.runner.longest_gap()
        hold(300_000)
        stalls.append(felt.runner.taken - before)
        gaps.append(felt.runner.longest_gap())

    seen = watch(sara, aside(sara, "sim://"), duration=2.5, each=each)
    assert stalls[0] > 150  # of 300; on a quiet machine all of them
    assert gaps[0] < 0.15
    assert np.all(np.round(np.diff(seen.times) * 1000) == 1)
    assert len(seen.times) == 2501


def test_what_reads_and_feels_goes_before_all_else_where_the_system_lets_it(sara):
    """Real-time priority: the reading process and two native threads, but no thread of Python."""
    allowed = []
    trial = threading.Thread(target=lambda: allowed.append(core.go_ahead()))
    trial.start()
    trial.join()
    if not allowed[0]:
        pytest.skip("this user may not have real-time priority")
    seen = {}

    def each(session):
        source = session.connection.source
        if source._felt is None or session.samples < 1300:
            return
        policies = [os.sched_getscheduler(int(task)) for task in os.listdir("/proc/self/task")]
        real = [p for p in policies if p & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO]
        seen["here"] = len(real)
        seen["main"] = os.sched_getscheduler(0)
        seen["aside"] = os.sched_getscheduler(source._process.pid) & ~os.SCHED_RESET_ON_FORK

    watch(sara, aside(sara, "sim://"), duration=2.0, each=each)
    assert seen == {"here": 2, "main": os.SCHED_OTHER, "aside": os.SCHED_FIFO}


def test_a_reading_process_that_is_killed_is_told_and_started_again(sara):
    killed = []

    def each(session):
        if session.samples > 1300 and not killed:
            killed.append(session.connection.source._process.pid)
            os.kill(killed[0], signal.SIGKILL)
        if killed and any("trying again" in n.text for n in session.seen.notices):
            session.connection.close()

    source = aside(sara, "sim://")
    seen = watch(sara, source, duration=20.0, each=each)
    assert any("trying again" in notice.text for notice in seen.notices)
    assert seen.events == [] or seen.times[-1] > 2.0


def test_it_goes_on_after_a_restart(sara):
    with Connection(aside(sara, "sim://")) as link:
        first = [s for _ in range(50) for s in link.read()]
        os.kill(link.source._process.pid, signal.SIGKILL)
        again, end = [], time.monotonic() + 20.0
        while not again and time.monotonic() < end:
            found = link.read()
            again += [s for s in found if any("trying again" in n.text for n in link.notices)]
    assert first and again


@pytest.mark.parametrize(
    ("address", "words"), [("sim://?sped=0", "sped"), ("replay://nowhere.mcap", "nowhere.mcap")]
)
def test_what_cannot_be_read_is_one_clear_error(sara, address, words):
    source = aside(sara, address)
    with pytest.raises(InputError, match=words):
        source.open()
    assert source._process is None


def test_the_end_of_a_recording_ends_it_and_nothing_stays_behind(sara, recorded):
    path, _ = recorded[".parquet"]
    source = ReadAside(f"replay://{path}?speed=0", sara, ("recording",))
    with Watched(sara, Connection(source)) as session:
        from live_support import Seen

        session.seen = Seen()
        session.start()
        for _ in session.run(None):
            pass
        process = source._process
    del session
    source._kill()
    assert process.poll() is not None
