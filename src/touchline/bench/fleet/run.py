# SPDX-License-Identifier: Apache-2.0
"""`touchline bench fleet`."""

import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from touchline.bench.fleet.recordings import UNREADABLE, make_recordings
from touchline.model.robot import load_robot

ROBOT = "sara-full"
MANIFEST = "manifest.jsonl"  # as the user finds it
DAMAGED = 0.02  # of the recordings
LAST = 0.9  # part of the recordings by which all kills have come
LOCKED = 2  # exit status while workers of a killed run still end
WAIT = 0.01  # s between looks
PATIENCE = 60.0  # s for workers of a killed run to end
Rows = dict[str, dict[str, Any]]


@dataclass
class Chaos:
    """What a run went through, and what was left in the end.

    Attributes:
        damages: name -> how it is damaged, or "".
        serial: rows of the manifest of one process that nobody disturbed.
        found: rows of the manifest of the run that was.
        lines: number of rows in that manifest.
        killed: number of workers killed.
        stopped: number of coordinators killed.
        seconds: of both runs, by the clock.
    """

    damages: dict[str, str]
    serial: Rows
    found: Rows = field(default_factory=dict)
    lines: int = 0
    killed: int = 0
    stopped: int = 0
    seconds: tuple[float, float] = (0.0, 0.0)

    def wrong(self) -> list[str]:
        """What is not as it must be."""
        out = []
        if self.lines != len(self.found) or set(self.found) != set(self.damages):
            out.append(f"{self.lines} rows of {len(self.damages)} recordings")
        for name, way in self.damages.items():
            row, own = self.found.get(name, {}), self.serial.get(name, {})
            keys = ("status", "samples", "flagged", "content", "outputs")
            if any(row.get(key) != own.get(key) for key in keys):
                out.append(f"{name}: {row.get('status')}, in one process {own.get('status')}")
            good = row.get("status") == "ok"
            if way in UNREADABLE and row.get("status") not in ("failed", "skipped"):
                out.append(f"{name}: {way}, but {row.get('status')}")
            elif way and way not in UNREADABLE and good and not row.get("flagged"):
                out.append(f"{name}: {way}, but ok")
            elif not way and not good:
                out.append(f"{name}: {row.get('status')}: {row.get('reason')}")
        return out


def main(recordings: int, kills: int, stops: int, workers: int, seed: int) -> int:
    """Print what became of all recordings."""
    with tempfile.TemporaryDirectory(prefix="touchline-bench-") as name:
        told = chaos(Path(name), recordings, kills, stops, workers, seed)
    ways = Counter(way for way in told.damages.values() if way)
    states = Counter(row["status"] for row in told.found.values())
    print(f"{recordings} recordings, {sum(ways.values())} damaged in {len(ways)} ways")
    print(f"{told.killed} workers and {told.stopped} coordinators killed, {workers} workers")
    print(", ".join(f"{count} {status}" for status, count in sorted(states.items())))
    print(f"one process {told.seconds[0]:.1f} s, with the kills {told.seconds[1]:.1f} s")
    wrong = told.wrong()
    print("\n".join(wrong[:20]) or "each accounted for once; hashes equal those of one process")
    return 1 if wrong else 0


def chaos(folder: Path, recordings: int, kills: int, stops: int, workers: int, seed: int) -> Chaos:
    """Analyze recordings in one process, and again while processes are killed at random.

    Args:
        folder: for all files.
        recordings: number of them.
        kills: of workers.
        stops: kills of the process that gives them work; the same command then goes on.
        workers: number of processes.
        seed: of when and which.
    """
    logs = folder / "logs"
    logs.mkdir()
    damages = make_recordings(logs, load_robot(ROBOT), recordings, round(DAMAGED * recordings))
    began = time.monotonic()
    _started(logs, folder / "serial", 1).wait()
    serial, _ = manifest_rows(folder / "serial")
    told = Chaos(damages, serial)
    middle = time.monotonic()
    _disturbed(logs, folder / "out", told, kills, stops, workers, random.Random(seed))
    told.found, told.lines = manifest_rows(folder / "out")
    told.seconds = middle - began, time.monotonic() - middle
    return told


def _disturbed(
    logs: Path, out: Path, told: Chaos, kills: int, stops: int, workers: int, chance: random.Random
) -> None:
    """Run until all is done; after so many rows each, one process is killed."""
    last = max(int(LAST * len(told.damages)), 1)
    moments = sorted(chance.randrange(1, last + 1) for _ in range(kills + stops))
    victims = ["worker"] * kills + ["coordinator"] * stops
    chance.shuffle(victims)
    process = _started(logs, out, workers)
    for moment, victim in zip(moments, victims, strict=True):
        while _count(out) < moment and process.poll() is None:
            time.sleep(WAIT)
        if process.poll() is not None:
            break
        if victim == "coordinator":
            process.kill()
            process.wait()
            told.stopped += 1
            process = _restarted(logs, out, workers)
            continue
        while process.poll() is None and not (found := _workers(process.pid)):
            time.sleep(WAIT)
        if process.poll() is None:
            os.kill(chance.choice(found), signal.SIGKILL)
            told.killed += 1
    process.wait()


def _started(logs: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    words = ["analyze", str(logs), "--robot", ROBOT, "--out", str(out), "--report", "none"]
    return subprocess.Popen(
        [sys.executable, "-m", "touchline", *words, "--workers", str(workers)],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
    )


def _restarted(logs: Path, out: Path, workers: int) -> subprocess.Popen[bytes]:
    """The same command again, as soon as the workers of the one that was killed have ended."""
    deadline = time.monotonic() + PATIENCE
    while True:
        process = _started(logs, out, workers)
        before = _count(out)
        while process.poll() is None and _count(out) == before and not _workers(process.pid):
            time.sleep(WAIT)
        if process.poll() != LOCKED or time.monotonic() > deadline:
            return process


def _workers(pid: int) -> list[int]:
    """Processes that a process has spawned to analyze (Linux)."""
    children = Path(f"/proc/{pid}/task/{pid}/children")
    try:
        found = [int(word) for word in children.read_text().split()]
        told = {child: Path(f"/proc/{child}/cmdline").read_bytes() for child in found}
    except OSError:  # ended in the meantime
        return []
    return [child for child, words in told.items() if b"spawn_main" in words]


def _count(out: Path) -> int:
    """Rows of a manifest that grows."""
    path = out / MANIFEST
    return path.read_bytes().count(b'{"name"') if path.is_file() else 0


def manifest_rows(out: Path) -> tuple[Rows, int]:
    """The rows of a manifest by their names, and how many lines it has."""
    lines = (out / MANIFEST).read_text(encoding="utf-8").splitlines()
    rows = [json.loads(line) for line in lines if line]
    return {row["name"]: row for row in rows}, len(rows)
