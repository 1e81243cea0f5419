# SPDX-License-Identifier: Apache-2.0
"""`touchline bench workers`: many recordings by one process, by several, and by a cluster."""

import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.fleet.run import MANIFEST, ROBOT, manifest_rows
from touchline.bench.logs.run import RATE, motion
from touchline.bench.tables import Row, aligned
from touchline.errors import InputError
from touchline.extras import need
from touchline.logs import write_table
from touchline.model.robot import load_robot

DIFFERENT = 4  # recordings that differ; the others are copies of these
GOAL = 1.9  # times as fast as one process, by two on two idle cores


@dataclass(frozen=True)
class Turn:
    """One analysis of all recordings.

    Attributes:
        name: who did it.
        seconds: by the clock.
        cpu: seconds of CPU of all processes; of a cluster not known.
        outputs: name of each recording -> its status and the hashes of its results.
    """

    name: str
    seconds: float
    cpu: float | None
    outputs: dict[str, Any]


def main(recordings: int, minutes: float, report: str, workers: int, dask: Sequence[int]) -> int:
    """Print how long each takes, and whether the results are the same."""
    if dask:
        need("distributed")
    with tempfile.TemporaryDirectory(prefix="touchline-bench-") as name:
        turns = _turns(Path(name), recordings, minutes, report, workers, dask)
    serial = turns[0]
    rows: list[Row] = [("analyzed by", "clock s", "CPU s", "times as fast", "results")]
    for turn in turns:
        cpu = "" if turn.cpu is None else f"{turn.cpu:.1f}"
        same = "the same" if turn.outputs == serial.outputs else "others"
        ratio = f"{serial.seconds / turn.seconds:.2f}"
        rows.append((turn.name, f"{turn.seconds:.1f}", cpu, ratio, same))
    print(f"{recordings} recordings of {minutes:g} minutes at 1 kHz, --report {report}")
    print(aligned(rows))
    print(f"goal: two processes on two idle cores {GOAL:g} times as fast as one")
    whole = all(turn.outputs == serial.outputs for turn in turns)
    good = all(status == "ok" for status, _ in serial.outputs.values())
    return 0 if whole and good and len(serial.outputs) == recordings else 1


def _turns(
    folder: Path, recordings: int, minutes: float, report: str, workers: int, dask: Sequence[int]
) -> list[Turn]:
    logs = folder / "logs"
    logs.mkdir()
    _make(logs, recordings, minutes)
    plain = {f"{count} process{'es' * (count > 1)}": count for count in (1, workers)}
    turns = []
    for name, count in plain.items():
        words = ["--workers", str(count)]
        turns.append(_turn(name, logs, folder / f"pool{count}", report, words))
    for count in dask:
        with _cluster(count) as address:
            words = ["--cluster", address]
            name = f"dask, {count} worker{'s' * (count > 1)}"
            turns.append(_turn(name, logs, folder / f"dask{count}", report, words, False))
    return turns


def _make(logs: Path, recordings: int, minutes: float) -> None:
    robot, length = load_robot(ROBOT), round(60 * minutes * RATE)
    samples = motion(robot, DIFFERENT * length, touched=True)
    for number in range(min(DIFFERENT, recordings)):
        rows = np.arange(len(samples)) // length == number
        path = logs / f"r{number:03d}.parquet"
        write_table(path, samples.where(rows), robot.description)
    for number in range(DIFFERENT, recordings):
        content = (logs / f"r{number % DIFFERENT:03d}.parquet").read_bytes()
        (logs / f"r{number:03d}.parquet").write_bytes(content)


def _turn(
    name: str, logs: Path, out: Path, report: str, words: Sequence[str], own: bool = True
) -> Turn:
    """`own`: are all processes that work started by this one?"""
    command = [sys.executable, "-m", "touchline", "analyze", str(logs), "--robot", ROBOT]
    command += ["--out", str(out), "--report", report, *words]
    began, cpu = time.monotonic(), _cpu()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds, spent = time.monotonic() - began, _cpu() - cpu
    if not (out / MANIFEST).is_file():
        raise InputError(f"{' '.join(command)}: exit status {done.returncode}: {done.stderr}")
    rows, _ = manifest_rows(out)
    outputs = {key: (row["status"], row["outputs"]) for key, row in rows.items()}
    return Turn(name, seconds, spent if own else None, outputs)


def _cpu() -> float:
    """Seconds of CPU of all processes that this one has started and that have ended."""
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


@contextmanager
def _cluster(workers: int) -> Any:
    """The address of a cluster on this machine, of processes with a thread each."""
    distributed = need("distributed")
    cluster = distributed.LocalCluster(
        n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
    )
    try:
        yield cluster.scheduler_address
    finally:
        cluster.close()
