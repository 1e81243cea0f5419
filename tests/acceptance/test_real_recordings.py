# SPDX-License-Identifier: Apache-2.0
"""Recordings of real arms, through the command line with the example descriptions."""

import csv
import gzip
import json
import os
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from touchline.cli import main

REPOSITORY = Path(__file__).parents[2]
DATA = Path(os.environ.get("TOUCHLINE_DATA", REPOSITORY.parent / "shared" / "data"))
ROBOTS = REPOSITORY / "examples" / "robots"
TOUCHES = ("a4", "a6", "b6", "b8", "c2", "c5", "d3", "f2")
TOUCHED_LINK = {"a": 7, "b": 6, "c": 5, "d": 4, "f": 2}
RESIDUAL_LIMITS = [0.45, 0.40, 0.35, 0.70, 0.25, 0.25, 0.10]  # Nm


def recording(name):
    path = DATA / name
    if not path.exists():
        pytest.skip(f"no recordings at {DATA}: set TOUCHLINE_DATA")
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    return path


def analyze(log, robot, out):
    with pytest.MonkeyPatch.context() as patch:  # pictures take longer than all the rest
        patch.setattr("touchline.report.event_figures.MOST_PICTURED", 1)
        assert main(["analyze", str(log), "--robot", str(ROBOTS / robot), "--out", str(out)]) == 0
    return json.loads((out / "events.json").read_text())


def labelled(path):
    """Time stamps, and (first, last) index of each labelled touch."""
    with gzip.open(path, "rt") as file:
        rows = [(float(r["time"]), float(r["label"]) > 0.5) for r in csv.DictReader(file)]
    time = np.array([stamp for stamp, _ in rows])
    label = np.array([touched for _, touched in rows])
    edges = np.diff(np.concatenate([[0], label.astype(int), [0]]))
    return time, list(zip(np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1, strict=True))


def span(event):
    return event["detected"], np.inf if event["cleared"] is None else event["cleared"]


@pytest.fixture(scope="module")
def touches(tmp_path_factory):
    """Per file: touches as intervals of time, and events."""
    found = {}
    for name in TOUCHES:
        path = recording(f"panda_touches/{name}.csv.gz")
        time, intervals = labelled(path)
        events = analyze(path, "panda_hand.yaml", tmp_path_factory.mktemp(name))
        found[name] = [(time[a], time[b]) for a, b in intervals], events
    return found


def overlap(a, b):
    return a[0] <= b[1] and b[0] <= a[1]


def test_at_most_one_touch_of_122_is_missed(touches):
    missed = [
        (name, touch)
        for name, (intervals, events) in touches.items()
        for touch in intervals
        if not any(overlap(touch, span(event)) for event in events)
    ]
    assert sum(len(intervals) for intervals, _ in touches.values()) == 122
    assert len(missed) <= 1, missed


def test_no_event_without_a_touch(touches):
    false = [
        (name, event["id"])
        for name, (intervals, events) in touches.items()
        for event in events
        if not any(overlap(touch, span(event)) for touch in intervals)
    ]
    assert false == []


def test_the_loaded_joint_is_not_beyond_the_touched_link(touches):
    beyond = [
        (name, event["id"], event["joint"])
        for name, (_, events) in touches.items()
        for event in events
        if event["joint"] and int(event["joint"][-1]) > TOUCHED_LINK[name[0]]
    ]
    assert len(beyond) <= 2, beyond


def settled_rms(out, joints):
    table = pq.read_table(out / "estimates.parquet")
    settled = np.array(table["health"]) & 1 == 0
    return [float(np.sqrt(np.mean(np.array(table[f"tau_ext.{j}"])[settled] ** 2))) for j in joints]


def test_a_quick_motion_of_a_real_panda_leaves_little_over(tmp_path):
    log = recording("panda_ur10_rosbag2/panda_exciting_trajectory.db3")
    events = analyze(log, "panda_no_hand.yaml", tmp_path)
    rms = settled_rms(tmp_path, [f"panda_joint{i}" for i in range(1, 8)])
    assert np.all(np.array(rms) <= RESIDUAL_LIMITS), rms
    assert events == []


def test_a_real_ur10_is_read_as_it_is(tmp_path):
    log = recording("panda_ur10_rosbag2/ur10_exciting_trajectory.db3")
    assert analyze(log, "ur10.yaml", tmp_path) == []
    assert pq.read_table(tmp_path / "estimates.parquet").num_rows == 3441


@pytest.mark.parametrize(
    ("log", "robot"),
    [
        ("panda_touches/c2.csv.gz", "panda_hand.yaml"),
        ("panda_ur10_rosbag2/panda_exciting_trajectory.db3", "panda_no_hand.yaml"),
        ("panda_ur10_rosbag2/ur10_exciting_trajectory.db3", "ur10.yaml"),
    ],
)
def test_check_finds_nothing_in_sound_recordings(log, robot, capsys):
    path = recording(log)
    assert main(["check", str(ROBOTS / robot), str(path)]) == 0, capsys.readouterr().out
