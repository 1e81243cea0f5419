# SPDX-License-Identifier: Apache-2.0
"""The benchmark of logs: its files say the same, and it prints what it measured."""

import numpy as np
import pytest

import touchline as tl
from touchline.bench.logs.files import serialized, write_mcap, write_sqlite
from touchline.bench.logs.run import motion
from touchline.cli import main
from touchline.logs import read_log


def test_all_files_hold_the_same_samples(tmp_path):
    robot = tl.load_robot("sara-full")
    samples = motion(robot, 2500)
    messages = serialized(robot, samples)
    write_sqlite(tmp_path / "a.db3", messages)
    for name in ("zstd", "lz4", ""):
        for summary in (True, False):
            write_mcap(tmp_path / f"a{name}{summary}.mcap", messages, name, summary)
    paths = list(tmp_path.iterdir())
    assert len(paths) == 7
    for path in paths:
        found = read_log(path, robot.description)
        np.testing.assert_allclose(found.time, samples.time, atol=1e-6)
        np.testing.assert_array_equal(found.q, samples.q)
        np.testing.assert_array_equal(found.wrench[5:-5], samples.wrench[5:-5])


def test_touches_are_found(tmp_path):
    robot = tl.load_robot("sara-full")
    samples, free = (motion(robot, 8000, touched) for touched in (True, False))
    pipeline = tl.Pipeline(robot)
    pipeline.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
    assert len(pipeline.events) >= 1
    assert abs(pipeline.events[0].detected - samples.time[0] - 5.0) < 0.1
    np.testing.assert_array_equal(samples.tau[:5000], free.tau[:5000])


def test_it_prints_rates(capsys):
    pytest.importorskip("rosbags")
    assert main(["bench", "logs", "--samples", "2000", "--minutes", "0.1"]) == 0
    out = capsys.readouterr().out
    for word in ("MCAP zstd, no summary", "rosbag2 sqlite3", "pyarrow, to a table", "per hour"):
        assert word in out


def test_labelling_is_measured(capsys):
    assert main(["bench", "label", "--hours", "0.02", "--episode", "12"]) == 0
    out = capsys.readouterr().out
    assert "6 episodes, 1080 samples at 15 Hz" in out and "100 hours at this pace" in out


def test_processes_are_compared(capsys):
    words = ["--recordings", "3", "--minutes", "0.1", "--report", "none"]
    assert main(["bench", "workers", *words]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "3 recordings of 0.1 minutes at 1 kHz, --report none"
    assert all(line.endswith("the same") for line in lines[2:4]) and len(lines) == 5
    assert main(["bench", "workers", "--minutes", "0"]) == 2
