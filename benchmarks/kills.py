# SPDX-License-Identifier: Apache-2.0
"""Commands killed at random, and on full disks: `kills.py [KILLS [POINTS]]`, 100 and 20 without.

Of `analyze`, `calibrate` and `simulate` in turn. After each the results must be the old ones or the
new ones, whole; after a full disk the command must say so, with status 1 or 2 and without a
traceback. Prints how many were neither.
"""

import hashlib
import resource
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from touchline.folder import settle

ROBOT = "sara"


def command(*words):
    """That runs this environment's Touchline."""
    return [sys.executable, "-m", "touchline", *map(str, words)]


def run(words, **options):
    """Its status and what it says."""
    return subprocess.run(words, capture_output=True, text=True, check=False, **options)


def jobs(folder):
    """By name: the two commands that write the same place in turns, and that place."""
    log, other = folder / "log.parquet", folder / "other.parquet"
    for path, seed in ((log, 0), (other, 1)):
        simulate = command(
            "simulate", "free_motion", "--seconds", 20, "--seed", seed, "--out", path
        )
        done = run(simulate)
        if done.returncode != 0:
            raise SystemExit(done.stderr)
    results, robot, table = folder / "results", folder / "robot.yaml", folder / "simulated.parquet"
    analyze = [command("analyze", x, "--robot", ROBOT, "--out", results) for x in (log, other)]
    calibrate = [command("calibrate", x, "--robot", ROBOT, "--out", robot) for x in (log, other)]
    simulate = [
        command("simulate", "free_motion", "--seconds", 5, "--seed", x, "--out", table)
        for x in (0, 1)
    ]
    return {
        "analyze": (analyze, results),
        "calibrate": (calibrate, robot),
        "simulate": (simulate, table),
    }


def state(place):
    """What stands there: a digest of all files; times and durations do not count."""
    if place.is_dir():
        settle(place)
        names = sorted(p for p in place.iterdir() if p.suffix in (".parquet", ".json"))
        parts = [p.read_bytes() for p in names if p.name != "analysis.json"]
        return hashlib.sha256(b"".join(parts)).hexdigest(), tuple(p.name for p in names)
    return hashlib.sha256(place.read_bytes() if place.exists() else b"").hexdigest()


def kill(words, seconds):
    """Ends a command after so long."""
    nothing = subprocess.DEVNULL
    running = subprocess.Popen(words, stdout=nothing, stderr=nothing)
    time.sleep(seconds)
    running.send_signal(signal.SIGKILL)
    running.wait()


def full(words, size):
    """Runs a command where no file can be larger than `size` bytes."""

    def limit():
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))

    return run(words, preexec_fn=limit)


def main(kills, points):
    """Prints what came of them."""
    rng, bad = np.random.default_rng(0), 0
    with tempfile.TemporaryDirectory() as name:
        for job, (both, place) in jobs(Path(name)).items():
            whole, durations = [], []
            for words in both:
                began = time.monotonic()
                done = run(words)
                durations.append(time.monotonic() - began)
                if done.returncode != 0:
                    raise SystemExit(f"{job}: {done.stderr}")
                whole.append(state(place))
            counts = [-(-kills // 3), -(-points // 3)]
            torn = 0
            for i in range(counts[0]):
                kill(both[i % 2], durations[i % 2] * rng.uniform(0.3, 1.05))
                torn += state(place) not in whole
            silent = 0
            for i in range(counts[1]):
                before = state(place)
                done = full(both[i % 2], int(2 ** rng.uniform(0.0, 16.0)))
                said = done.returncode in (0, 1, 2) and "Traceback" not in done.stderr
                silent += not said or (done.returncode != 0 and state(place) != before)
            bad += torn + silent
            print(f"{job}: {counts[0]} kills, {torn} torn; {counts[1]} full disks, {silent} untold")
    return int(bad > 0)


if __name__ == "__main__":
    sys.exit(main(*(int(word) for word in (sys.argv[1:] + ["100", "20"][len(sys.argv) - 1 :]))))
