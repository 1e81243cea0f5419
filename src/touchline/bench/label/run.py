# SPDX-License-Identifier: Apache-2.0
"""`touchline bench label`."""

import json
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.logs.run import RATE, ROBOT, motion
from touchline.errors import InputError
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples

SLOW = 15.0  # Hz, of data for learning
DIFFERENT = 12  # episodes that differ; the others are copies of these
FILE_HOURS = 1.0  # in a file of the data set
GOAL_HOURS, GOAL = 100.0, 300.0  # so many are labelled in so many seconds, on two idle cores


def main(hours: float, episode: float) -> int:
    """Print what the command takes for such a data set."""
    with tempfile.TemporaryDirectory(prefix="touchline-bench-") as name:
        folder = Path(name) / "set"
        made = make_dataset(folder, load_robot(ROBOT), hours, episode)
        command = [sys.executable, "-m", "touchline", "label", str(folder), "--robot", ROBOT]
        began, cpu = time.monotonic(), _cpu()
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        seconds, spent = time.monotonic() - began, _cpu() - cpu
    if done.returncode:
        raise InputError(f"{' '.join(command)}: exit status {done.returncode}: {done.stderr}")
    print(done.stdout.strip())
    part = GOAL_HOURS / made
    print(f"{made:.2f} hours: {seconds:.1f} s by the clock, {spent:.1f} s of CPU")
    print(
        f"{GOAL_HOURS:g} hours at this pace: {part * seconds:.0f} s by the clock, "
        f"{part * spent:.0f} s of CPU; goal: {GOAL:g} s by the clock on two idle cores"
    )
    return 0


def make_dataset(folder: Path, robot: Robot, hours: float, episode: float) -> float:
    """Write a LeRobot data set (v3) of slow motions that are touched; how many hours it has."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    episodes = _episodes(robot, episode)
    total = max(round(3600 * hours / episode), 1)
    together = max(round(3600 * FILE_HOURS / episode), 1)
    signals = {
        "observation.state.joint_position": lambda s: s.q,
        "observation.state.joint_velocity": lambda s: s.qd,
        "observation.state.joint_torque": lambda s: s.tau,
        "observation.wrench": lambda s: s.wrench.reshape(len(s), -1),
    }
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    rows = 0
    for first in range(0, total, together):
        members = range(first, min(first + together, total))
        parts = [episodes[number % DIFFERENT] for number in members]
        counts = [len(part) for part in parts]
        columns: dict[str, Any] = {}
        for name, of in signals.items():
            values = np.concatenate([of(part) for part in parts]).astype(np.float32)
            flat = pa.array(values.ravel())
            columns[name] = pa.FixedSizeListArray.from_arrays(flat, values.shape[1])
        stamps = np.concatenate([np.arange(count) / SLOW for count in counts])
        columns["timestamp"] = stamps.astype(np.float32)
        columns["episode_index"] = np.repeat(np.array(members), counts)
        pq.write_table(pa.table(columns), data / f"file-{first // together:03d}.parquet")
        rows += sum(counts)
    widths = {name: of(episodes[0]).shape[1] for name, of in signals.items()}
    features = {name: {"dtype": "float32", "shape": [width]} for name, width in widths.items()}
    info = {"codebase_version": "v3.0", "fps": SLOW, "features": features}
    (folder / "meta").mkdir()
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return rows / SLOW / 3600


def _episodes(robot: Robot, seconds: float) -> list[Samples]:
    """Episodes that differ, as a fast recording shows them at the lower rate."""
    length = round(seconds * RATE)
    samples = motion(robot, DIFFERENT * length, touched=True)
    rows = np.round(np.arange(0, length, RATE / SLOW)).astype(int)
    rows = rows[rows < length]
    return [
        Samples(
            *(
                getattr(samples, name)[number * length + rows]
                for name in ("time", "q", "qd", "tau", "wrench")
            )
        )
        for number in range(DIFFERENT)
    ]


def _cpu() -> float:
    """Seconds of CPU of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime
