# SPDX-License-Identifier: Apache-2.0
"""A fleet of which some recordings are damaged in eight ways, while processes are killed."""

import gzip
import json
import os
import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.cli import main
from touchline.fleet.manifest import MANIFEST, Manifest
from touchline.logs import write_table

COUNT = 40
KILLS = 4  # of workers, and two of the one who gives them work


@pytest.fixture(scope="module")
def fleet(tmp_path_factory):
    """COUNT short recordings, then one damaged in each of eight ways."""
    folder = tmp_path_factory.mktemp("fleet")
    robot = tl.load_robot("sara")
    samples = free_motion(robot, seconds=0.5, rate=200.0)
    for i in range(COUNT):
        write_table(folder / f"n{i:03d}.parquet", samples, robot.description)
    whole = (folder / "n000.parquet").read_bytes()
    (folder / "truncated.parquet").write_bytes(whole[: len(whole) // 2])
    (folder / "empty.parquet").write_bytes(b"")
    (folder / "foreign.mcap").write_bytes(b"no recording" * 99)
    samples.q[:] = np.nan
    write_table(folder / "nan.parquet", samples, robot.description)
    samples = free_motion(robot, seconds=0.5, rate=200.0)
    write_table(folder / "joints.csv", samples, robot.description)
    text = (folder / "joints.csv").read_text().replace("q.joint1", "q.elsewhere", 1)
    (folder / "joints.csv").write_text(text)
    samples.time[50:] = 1e300
    write_table(folder / "stamps.parquet", samples, robot.description)
    (folder / "bomb.csv.gz").write_bytes(gzip.compress(b"0" * (1 << 26)))
    (folder / "unreadable.db3").mkdir()
    return folder


# What must not pass for a good recording; NaN and stamps are told of by the health of samples.
FAILED = {"truncated", "empty", "foreign", "joints", "bomb", "unreadable"}


def rows(out):
    found = [json.loads(line) for line in (out / MANIFEST).read_text().splitlines()]
    return {row["name"]: (row["status"], row["flagged"], row["outputs"]) for row in found}, found


def command(fleet, out, workers):
    return ["analyze", str(fleet), "--robot", "sara", "--out", str(out), "--report", "none"] + [
        "--workers",
        str(workers),
    ]


def children(pid):
    command = ["ps", "--ppid", str(pid), "-o", "pid=,args="]
    found = subprocess.run(command, check=False, capture_output=True)
    lines = found.stdout.decode().splitlines()
    return [int(line.split()[0]) for line in lines if "spawn_main" in line]


def test_every_recording_is_accounted_for_once(fleet, tmp_path):
    serial, out = tmp_path / "serial", tmp_path / "out"
    assert main(command(fleet, serial, 1)) == 3
    expected, told = rows(serial)
    assert len(told) == len(expected) >= COUNT + 7
    for name, (status, flagged, _) in expected.items():
        if name in FAILED:
            assert status in ("failed", "skipped")
        elif name.startswith("n") and name != "nan":
            assert status == "ok"
        else:
            assert status != "ok" or flagged > 0
    environment = os.environ | {"PYTHONPATH": str(Path(tl.__file__).parents[1])}
    chance = random.Random(0)
    for turn in range(2):
        process = subprocess.Popen(
            [sys.executable, "-m", "touchline", *command(fleet, out, 2)],
            env=environment,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        begun = len(Manifest(out).rows)
        deadline = time.monotonic() + 120
        for kill in range(KILLS // 2):
            wanted = begun + 4 * (kill + 1)
            while len(Manifest(out).rows) < wanted and time.monotonic() < deadline:
                time.sleep(0.02)
            workers = children(process.pid)
            if workers:
                os.kill(chance.choice(workers), signal.SIGKILL)
        assert process.poll() is None, f"turn {turn}: ended before it was killed"
        process.kill()
        process.wait()
    deadline = time.monotonic() + 60  # workers of the killed run end when their pipe is closed
    while (status := main(command(fleet, out, 2))) == 2 and time.monotonic() < deadline:
        time.sleep(0.5)
    assert status == 3
    found, told = rows(out)
    assert len(told) == len(found)
    assert found == expected
