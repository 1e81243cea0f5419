# SPDX-License-Identifier: Apache-2.0
"""What is recorded live gives the same bits again, and survives a kill."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pyarrow.parquet as pq
import pytest
from live_support import SECONDS, assert_same, watch

import touchline as tl
from touchline.errors import InputError
from touchline.live.recorder import make_recorder
from touchline.live.sample import make_sample, on_nanoseconds
from touchline.logs import open_log, read_log
from touchline.report.analysis import analyze


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_replay_of_a_recording_gives_the_same_bits(sara, recorded, suffix):
    path, live = recorded[suffix]
    assert len(live.times) == round(1000 * SECONDS) + 1 and len(live.events) == 1
    assert_same(watch(sara, f"replay://{path}?speed=0", duration=None), live)


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_analyze_of_a_recording_gives_the_same_bits(sara, recorded, suffix, tmp_path):
    path, live = recorded[suffix]
    found = analyze(path, "sara", tmp_path, report=False)
    assert [event.as_json() for event in found.events] == live.events
    table = pq.read_table(tmp_path / "estimates.parquet")
    n = len(sara.joint_names)
    for j, name in enumerate(sara.joint_names):
        values = table[f"tau_ext.{name}"].to_numpy()
        expected = np.array([rows[j] for rows in live.rows])
        assert np.array_equal(values, expected, equal_nan=True)
    assert n == 7


def test_the_same_seed_gives_the_same_recording_at_any_speed(sara, recorded):
    live = recorded[".parquet"][1]
    slow = watch(sara, "sim://", duration=1.5)
    assert slow.times == live.times[: len(slow.times)]
    assert np.array_equal(slow.rows, live.rows[: len(slow.rows)], equal_nan=True)


def test_the_simulated_arm_moves_for_long_and_is_not_felt_where_nothing_touches_it(sara):
    seen = watch(sara, "sim://?speed=0&force=0", duration=20.0)
    assert len(seen.times) == 20001 and seen.events == []
    estimates = np.array(seen.rows)[6000:, 1:7]
    assert np.isfinite(estimates[:, [0, 1, 2, 3]]).all()


def test_what_is_recorded_holds_arrival_and_sequence(recorded):
    table = pq.read_table(recorded[".parquet"][0])
    assert table["sequence"].to_pylist() == list(range(len(table)))
    assert np.all(np.diff(table["arrival"].to_numpy()) >= 0.0)
    assert set(table.column_names) >= {"base.age", "wrist.age", "handle.age"}


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_a_killed_run_leaves_a_readable_recording(suffix, tmp_path, sara):
    path = tmp_path / f"killed{suffix}"
    command = [sys.executable, "-m", "touchline", "live", "--robot", "sara", "--source", "sim://"]
    process = subprocess.Popen([*command, "--record", str(path)], stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("live"):
            break
    time.sleep(3.0)
    os.kill(process.pid, signal.SIGKILL)
    process.wait()
    process.stdout.close()
    samples = read_log(path, sara.description)
    assert samples.time[0] == 0.0
    assert len(samples) > 1000 and np.all(np.diff(samples.time) > 0.0)
    assert np.isfinite(samples.q).all() and np.isfinite(samples.wrench).all()


def _may_be_interrupted():
    # Whoever runs the tests in the background has the signal ignored, and so have their children.
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_ctrl_c_leaves_a_whole_recording(suffix, tmp_path, sara):
    path = tmp_path / f"stopped{suffix}"
    command = [sys.executable, "-m", "touchline", "live", "--robot", "sara", "--source", "sim://"]
    process = subprocess.Popen(
        [*command, "--record", str(path)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=_may_be_interrupted,  # noqa: PLW1509
    )
    assert process.stdout is not None
    for line in process.stdout:
        if line.startswith("live"):
            break
    time.sleep(4.0)  # so long that a busy machine has simulated a second
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=30)
    assert process.returncode == 0 and err == ""
    assert f"recording: {path}" in out
    with open_log(path, sara.description) as log:
        rows = sum(len(part) for part in log.chunks())
        assert log.warnings == [] and rows > 1000


def test_units_and_names_of_the_log_key_are_not_applied_twice(tmp_path, sara):
    from dataclasses import replace

    from touchline.model.robot import Robot

    log = {"tau": {"factor": 0.001}, "joint_names": {sara.joint_names[0]: "axis_1"}}
    odd = Robot(replace(sara.description, log=log), sara.mechanism)
    q = np.arange(7.0)
    sample = make_sample(odd, 1.5, q, q, q, np.ones((3, 6)), arrival=7.0, sequence=3)
    for name in ("odd.parquet", "odd.mcap"):
        with make_recorder(tmp_path / name, odd, 1e-3, "test://") as recorder:
            recorder.add(sample)
        again = read_log(tmp_path / name, odd.description)
        for signal_name in ("q", "qd", "tau", "wrench"):
            expected = getattr(sample, signal_name)
            assert np.array_equal(getattr(again, signal_name)[0], expected, equal_nan=True)
        assert again.time[0] == 1.5


def test_the_period_of_a_recording_is_the_one_it_was_seen_with(tmp_path, sara):
    for name in ("p.parquet", "p.mcap"):
        with make_recorder(tmp_path / name, sara, 0.00123, "test://") as recorder:
            for i in range(10):
                at, zeros = on_nanoseconds(0.001 * i), np.zeros(7)
                recorder.add(make_sample(sara, at, zeros, zeros, zeros))
        with open_log(tmp_path / name, sara.description) as log:
            assert log.metadata["period"] == 0.00123
            assert log.metadata["recorder"] == "touchline live"


def test_a_recording_has_a_known_suffix_and_a_writable_place(tmp_path, sara):
    with pytest.raises(InputError, match=r"ends in \.mcap or \.parquet"):
        make_recorder(tmp_path / "x.csv", sara, 1e-3, "")
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="cannot be written"):
        make_recorder(tmp_path / "file" / "x.mcap", sara, 1e-3, "")
    with pytest.raises(InputError, match="cannot be written"):
        make_recorder(tmp_path / "file" / "x.parquet", sara, 1e-3, "")


def test_connect_gives_what_update_takes(sara):
    pipeline = tl.Pipeline(sara)
    with tl.live.connect("sim://?speed=0&force=0", sara) as samples:
        for sample in samples:
            result = pipeline.update(*sample)
            if sample.sequence == 300:
                break
    assert sample.time == on_nanoseconds(0.3) and result.health == 0 and result.contacts == []
    assert sample.valid.q.all() and sample.valid.wrench.all() and not sample.valid.tau[0]
