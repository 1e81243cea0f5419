# SPDX-License-Identifier: Apache-2.0
"""A UR arm over RTDE, against a controller that is written for the test."""

import ctypes
import socket
import struct
import subprocess
import sys
import threading
import time

import numpy as np
import pytest
from fake_rtde import FakeController
from live_arms import make_arm, pushed
from live_support import assert_same, watch

from touchline.cli.main import main
from touchline.errors import InputError
from touchline.live import rtde
from touchline.live.adapters import from_ur_rtde
from touchline.live.connection import Connection
from touchline.live.source import LinkLost
from touchline.live.sources import connect, make_source


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    return make_arm(tmp_path_factory.mktemp("arm"), 6)


@pytest.fixture(scope="module")
def samples(arm):
    return pushed(arm, seconds=20.0, begin=2.0)


def test_no_sample_is_lost_and_all_are_as_they_were_sent(arm, samples):
    with FakeController(samples) as controller, connect(controller.address, arm) as link:
        got = []
        while len(got) < 1000:
            got += link.read()
        assert link.streams[0].lost == 0 and link.refused == 0
        numbers = [s.sequence for s in got]
        assert numbers == list(range(1000 if len(got) == 1000 else len(got)))
        first = round(got[0].time * 500)
        for sample in got[::100]:
            i = first + sample.sequence
            assert np.array_equal(sample.q, samples.q[i])
            assert np.array_equal(sample.tau, samples.tau[i])
            assert np.array_equal(sample.wrench, samples.wrench[i])
            assert sample.time == pytest.approx(i / 500, abs=1e-9)


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_what_was_live_is_replayed_to_the_last_bit(arm, samples, tmp_path, suffix):
    path = tmp_path / f"ur{suffix}"
    with FakeController(samples) as controller:
        live = watch(arm, controller.address, path, duration=3.5)
    assert len(live.events) == 1 and live.events[0]["force_peak"] is None
    assert_same(watch(arm, f"replay://{path}?speed=0", duration=None), live)


def test_a_field_that_is_not_there_is_replaced_or_told(arm, samples):
    with FakeController(samples, lacks=["ft_raw_wrench"]) as controller:
        link = connect(controller.address, arm)
        assert any("actual_TCP_force" in note for note in link.notes)
        link.close()
    with FakeController(samples, lacks=["actual_current_as_torque"]) as controller:
        with pytest.raises(InputError, match="no actual_current_as_torque, only currents"):
            connect(controller.address, arm)
    with FakeController(samples, lacks=["actual_q"]) as controller:
        with pytest.raises(InputError, match="has no actual_q"):
            connect(controller.address, arm)


def test_currents_are_read_where_the_description_gives_gains(samples, tmp_path):
    arm = make_arm(tmp_path, 6)
    path = tmp_path / "robot.yaml"
    path.write_text(path.read_text().replace("torque: sensor", "torque: sensor, gain: 10.0"))
    from touchline.model.robot import load_robot

    arm = load_robot(path)
    with FakeController(samples) as controller, connect(controller.address, arm) as link:
        (sample, *_) = link.read()
        assert np.allclose(sample.tau, samples.tau[0] / 10.0, atol=0.1)
        assert any("actual_current [A" in note for note in link.notes)


def _answering(data):
    """A server that is none of a robot: it answers everything with the same bytes."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve():
        try:
            client = listener.accept()[0]
            client.recv(100)
            if data is not None:
                client.sendall(data)
            time.sleep(3.0)
            client.close()
        except OSError:
            pass

    threading.Thread(target=serve, daemon=True).start()
    return listener


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "does not speak RTDE"),
        (b"SSH-2.0-OpenSSH_9.2\r\n", "does not speak RTDE"),
        (None, "does not answer"),
    ],
)
def test_a_foreign_server_is_one_clear_line(data, words, samples, tmp_path, capsys):
    make_arm(tmp_path, 6)
    listener = _answering(data)
    source = f"ur://127.0.0.1:{listener.getsockname()[1]}"
    assert main(["live", "--robot", str(tmp_path / "robot.yaml"), "--source", source]) == 2
    err = capsys.readouterr().err
    assert words in err and len(err.strip().splitlines()) == 1
    listener.close()


def _scripted(*answers):
    """A controller that accepts the protocol, and then answers each request as is written."""
    listener = socket.create_server(("127.0.0.1", 0))

    def serve():
        client = listener.accept()[0]
        with client:
            for answer in (rtde.package(rtde.Command.PROTOCOL_VERSION, b"\x01"), *answers):
                if not client.recv(1000):
                    return
                client.sendall(answer)
            time.sleep(0.2)

    threading.Thread(target=serve, daemon=True).start()
    return listener, rtde.Rtde("127.0.0.1", listener.getsockname()[1])


def _fields(kinds):
    return rtde.package(rtde.Command.OUTPUTS, b"\x01" + kinds.encode())


@pytest.mark.parametrize(
    ("kinds", "words"),
    [
        ("DOUBLE", "gives 1 types for 2 fields"),
        ("NOT_FOUND,NOT_FOUND", "has none of the fields timestamp, actual_q"),
        ("DOUBLE,STRING", "fields of unknown type STRING"),
    ],
)
def test_fields_that_cannot_be_read_are_told(kinds, words):
    listener, link = _scripted(_fields(kinds))
    with listener, link, pytest.raises(InputError, match=words):
        link.outputs(["timestamp", "actual_q"], 500.0)


def test_words_of_a_controller_are_kept_and_other_packages_left_out():
    said = rtde.package(rtde.Command.TEXT, b"\x05hello" + b"rest")
    start, other = rtde.package(rtde.Command.START, b"\x01"), rtde.Command.DATA
    data = rtde.package(other, struct.pack(">Bd", 1, 0.5))
    listener, link = _scripted(_fields("DOUBLE"), said + start + said + data)
    with listener, link:
        recipe, missing = link.outputs(["timestamp"], 500.0)
        assert (recipe.size, recipe.offset("timestamp"), recipe.offset(None)) == (9, 1, -1)
        link.start()
        (payload,) = link.receive(1.0)
        assert link.messages == ["hello", "hello"] and missing == []
        assert recipe.read(payload) == {"timestamp": (0.5,)}
        assert recipe.read(payload[:-1]) is None and recipe.read(b"\x02" + payload[1:]) is None


@pytest.mark.parametrize(
    ("answer", "words"),
    [
        (rtde.package(rtde.Command.START, b"\x00"), "does not start to send"),
        (rtde.package(rtde.Command.START, b"\x01") + b"HTTP/1.1", "sends no RTDE any more"),
        (rtde.package(rtde.Command.START, b"\x01"), "has closed the connection"),
    ],
)
def test_a_link_that_is_lost_is_told(answer, words):
    listener, link = _scripted(answer)

    def follow():
        link.start()
        while True:
            link.receive(0.1)

    with listener, link, pytest.raises(LinkLost, match=words):
        follow()


class Receiver:
    """As much of `RTDEReceiveInterface` as is read."""

    def __getattr__(self, name):
        at = ["getActualQ", "getActualQd", "getActualCurrent", "getFtRawWrench"]
        at += ["getActualTCPForce", "getTimestamp"]
        number = at.index(name)
        return lambda: 2.5 if name == "getTimestamp" else [float(number)] * 6


def test_a_state_of_the_public_client_is_a_sample(arm):
    sample = from_ur_rtde(arm, Receiver(), arrival=7.0)
    assert (sample.time, sample.arrival) == (2.5, 7.0)
    np.testing.assert_array_equal(sample.q, np.zeros(6))
    np.testing.assert_array_equal(sample.qd, np.ones(6))
    np.testing.assert_array_equal(sample.tau, np.full(6, 2.0))
    np.testing.assert_array_equal(sample.wrench, np.full((1, 6), 3.0))


def test_nobody_there_an_old_protocol_a_wrong_robot(arm, samples, sara, tmp_path, capsys):
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    with pytest.raises(InputError, match="cannot be reached"):
        connect(f"ur://127.0.0.1:{port}", arm)
    with pytest.raises(InputError, match="no such host"):
        connect("ur://no.such.host.invalid", arm)
    with FakeController(samples, version=1) as controller:
        with pytest.raises(InputError, match="refuses version 2"):
            connect(controller.address, arm)
    with pytest.raises(InputError, match="6 joints and one sensor at most"):
        connect("ur://127.0.0.1", sara)
    with pytest.raises(InputError, match="expected ur://HOST"):
        connect("ur://", arm)


def follow(controller, arm, seconds, act):
    """Reads for so long; `act(elapsed)` does what happens to the link. Samples and notices."""
    link = Connection(make_source(controller.address, arm))
    link.open()
    link.notices.clear()
    got, begin = [], time.monotonic()
    while (elapsed := time.monotonic() - begin) < seconds:
        act(elapsed, link)
        got += link.read()
    link.close()
    return got, list(link.notices), link


@pytest.mark.parametrize("pause", [0.3, 0.8])
def test_a_pause_is_told_within_20_ms_and_passes(arm, samples, pause):
    with FakeController(samples) as controller:
        marks = {}

        def act(elapsed, link):
            if elapsed > 0.5 and "off" not in marks:
                controller.paused.set()
                marks["off"] = time.monotonic()
            if elapsed > 0.5 + pause and "on" not in marks:
                controller.paused.clear()
                marks["on"] = time.monotonic()

        got, notices, link = follow(controller, arm, 1.0 + pause, act)
    stale = next(n for n in notices if n.state == "stale")
    # 20 ms, as test_live_streams.py shows on a clock of its own, and what a busy machine adds.
    assert stale.at - marks["off"] < 0.25
    back = next(s.arrival for s in got if s.arrival > marks["on"])
    assert back - marks["on"] < 0.5
    assert link.streams[0].lost == 0


def test_a_controller_that_is_gone_is_found_again(arm, samples):
    controller = FakeController(samples)
    port = controller.port
    marks = {}

    def act(elapsed, link):
        if elapsed > 0.4 and "off" not in marks:
            marks["first"] = controller
            controller.stop()
            marks["off"] = time.monotonic()
        if elapsed > 0.9 and "on" not in marks:
            marks["again"] = FakeController(samples, port=port)
            marks["on"] = time.monotonic()

    got, notices, link = follow(controller, arm, 1.6, act)
    marks["again"].stop()
    assert any("trying again" in n.text for n in notices)
    back = next(s.arrival for s in got if s.arrival > marks["on"])
    assert back - marks["on"] < 0.5  # 0.1 s, and what a busy machine adds
    assert got[-1].arrival > marks["on"]


def test_doubled_and_reordered_samples_are_refused_and_dropped_ones_counted(arm, samples):
    def tamper(due):
        kept = []
        for i, data in due:
            if i % 50 == 7:
                continue
            kept += [(i, data)] * (2 if i % 50 == 20 else 1)
        return kept[::-1] if due[0][0] % 40 == 0 else kept

    with FakeController(samples, tamper=tamper) as controller:
        got, _, link = follow(controller, arm, 1.0, lambda elapsed, link: None)
    times = [s.time for s in got]
    assert times == sorted(set(times))
    assert link.refused >= 5 and link.streams[0].lost >= 8


def test_late_samples_are_told_as_slow(arm, samples):
    held = []

    def tamper(due):
        if due[0][0] < 300:
            return due
        held.extend(due)
        ready = [entry for entry in held if entry[0] <= due[-1][0] - 15]
        del held[: len(ready)]
        return ready

    with FakeController(samples, tamper=tamper) as controller:
        _, notices, _ = follow(controller, arm, 1.2, lambda elapsed, link: None)
    assert any(n.state == "slow" for n in notices)


@pytest.mark.parametrize("jump", [-0.5, 3.0, -100.0])
def test_a_clock_that_jumps_makes_no_event(arm, jump):
    with FakeController(pushed(arm, seconds=4.0, begin=1e3)) as controller:

        def each(session):
            if session.samples > 700:
                controller.clock = jump

        seen = watch(arm, controller.address, duration=1.9 if jump < 0 else None, each=stop(each))
    assert seen.events == []
    if jump < 0:
        assert any("the clock was set back by" in notice.text for notice in seen.notices)


def stop(each):
    """Ends a session 0.4 s after 700 samples."""

    def act(session):
        each(session)
        if session.samples > 900:
            session.connection.close()

    return act


def test_a_stall_of_python_costs_no_sample_and_no_time(arm, samples):
    hold = ctypes.PyDLL(None).usleep  # a call that keeps the interpreter's lock
    with FakeController(samples, apart=True) as controller:
        stalls, gaps = [], []

        def each(session):
            felt = session.connection.source._felt
            if felt is None or session.samples < 600 or stalls:
                return
            before = felt.runner.taken
            felt.runner.longest_gap()
            hold(300_000)
            stalls.append(felt.runner.taken - before)
            gaps.append(felt.runner.longest_gap())

        seen = watch(arm, controller.address, duration=2.5, each=each)
    assert stalls[0] > 75  # of 150; on a quiet machine all of them
    assert gaps[0] < 0.15
    steps = np.round(np.diff(seen.times) * 500)
    assert np.all(steps == 1)


def test_what_native_threads_read_survives_a_restart_of_the_controller(arm, samples):
    first = FakeController(samples)
    again = []

    def each(session):
        if session.samples > 700 and not again:
            first.stop()
            again.append(FakeController(samples, port=first.port))
            again[0].clock = 100.0

    seen = watch(arm, first.address, duration=101.0, each=each)
    again[0].stop()
    assert any("trying again" in notice.text for notice in seen.notices)
    assert seen.times[-1] > 100.0 and seen.events == []


def test_a_session_that_is_reset_goes_on(arm, samples):
    with FakeController(samples) as controller:
        done = []

        def each(session):
            if session.samples > 600 and not done:
                done.append(session.reset())

        seen = watch(arm, controller.address, duration=1.9, each=each)
    assert (
        done == ["reset: the estimate starts anew"] and len(seen.times) > 800 and seen.events == []
    )


PUBLIC = """
import sys, rtde_receive
import touchline as tl
names = ["timestamp", "actual_q", "actual_qd", "actual_current", "ft_raw_wrench"]
receive = rtde_receive.RTDEReceiveInterface("127.0.0.1", 500.0, names)
sample = tl.live.from_ur_rtde(tl.load_robot(sys.argv[1]), receive)
print(sample.q.tolist(), sample.time)
"""


def test_the_public_client_reads_the_fake_controller_and_its_state_makes_a_sample(
    samples, tmp_path
):
    pytest.importorskip("rtde_receive", reason="ur-rtde is not installed")
    make_arm(tmp_path, 6)
    try:
        controller = FakeController(samples, port=30004)
    except OSError:
        pytest.skip("port 30004 is taken")
    command = [sys.executable, "-c", PUBLIC, str(tmp_path / "robot.yaml")]
    with controller:
        done = subprocess.run(command, check=False, capture_output=True, timeout=60)
    assert done.returncode == 0, done.stderr
    assert f"{samples.q[0, 0]:.3f}"[:4] in done.stdout.decode()
