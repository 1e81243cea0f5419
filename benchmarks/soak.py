# SPDX-License-Identifier: Apache-2.0
"""A pipeline that runs for long: `soak.py [SAMPLES] [--native]`, 1e8 without it (a day of 1 kHz).

An arm swings and is pushed, again and again, with a pause of a minute between. Prints the resident
memory as it goes, its slope over the second half in MB an hour of 1 kHz and of wall time. Tells
whether a pipeline that has been reset afterwards says what a fresh one says, to the last bit.

With `--native` a C++ program (soak.cpp) does it on the exported robot, without Python.
"""

import resource
import subprocess
import sys
import time as clock
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

import touchline as tl
from touchline.trials.recordings import record

PAUSE = 60.0  # s of recorded time between two pushes
GAP = 0.5  # s without samples after each recording: the next one begins in another posture
PARTS = 20  # prints of the memory
HERE = Path(__file__).parent


def resident():
    """Of this process [MB]."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 1e6


def said(pipeline, s):
    """All that is said of a recording."""
    before = len(pipeline.events)
    estimate, _ = pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return estimate.rows, [
        (e.detected, e.cleared, e.body, e.force) for e in pipeline.events[before:]
    ]


def main(samples):
    """Prints what came of it."""
    robot = tl.load_robot("sara")
    touched, free = record(robot, 0).samples, record(robot, 0, pushed=False).samples
    pipeline = tl.Pipeline(robot)
    length, pushes = len(touched), 0
    rounds = round(PAUSE / (touched.time[-1] + 1e-3))
    done, shift, sizes, began = 0, 0.0, [], clock.monotonic()
    while done < samples:
        for i in range(rounds):
            s = touched if i == 0 else free
            pushes += i == 0
            pipeline.run(s.time + shift, s.q, s.qd, s.tau, s.wrench)
            shift += length * 1e-3 + GAP
            done += length
        if done >= samples * (len(sizes) + 1) / PARTS:
            sizes.append((done, clock.monotonic() - began, resident()))
            print(f"{done:.2e} samples, {sizes[-1][1]:.0f} s: {sizes[-1][2]:.1f} MB", flush=True)
    half = np.array(sizes[len(sizes) // 2 :])
    recorded = np.polyfit(half[:, 0] / 3.6e6, half[:, 2], 1)[0] if len(half) > 2 else np.nan
    wall = np.polyfit(half[:, 1] / 3600.0, half[:, 2], 1)[0] if len(half) > 2 else np.nan
    events = len(pipeline.events)
    pipeline.reset()
    rows, told = said(pipeline, touched)
    fresh_rows, fresh_told = said(tl.Pipeline(robot), touched)
    same = np.array_equal(rows, fresh_rows, equal_nan=True) and repr(told) == repr(fresh_told)
    print(f"{done:.3g} samples, {pushes} pushes, {events} events")
    print(f"{recorded:.2f} MB an hour of 1 kHz, {wall:.1f} of wall time")
    print(f"reset and fresh: {'the same bits' if same else 'they differ'}")
    return int(not same or events < pushes)


def native(samples):
    """The same without Python: compiles soak.cpp and runs it on the exported robot."""
    robot = tl.load_robot("sara")
    with TemporaryDirectory() as folder:
        program, exported = Path(folder, "soak"), Path(folder, "sara.touchline")
        tl.Pipeline(robot).export(exported)
        for name in ("touched", "free"):
            s = record(robot, 0, pushed=name == "touched").samples
            flat = s.wrench.reshape(len(s), -1)
            np.column_stack([s.time, s.q, s.qd, s.tau, flat]).tofile(Path(folder, name))
        include = HERE.parent / "core" / "include"
        flags = ["-std=c++17", "-O2", "-ffp-contract=off", f"-I{include}"]
        subprocess.run(["c++", *flags, HERE / "soak.cpp", "-o", program], check=True)
        logs = [Path(folder, "touched"), Path(folder, "free")]
        return subprocess.run([program, exported, *logs, str(samples)], check=False).returncode


if __name__ == "__main__":
    given = [a for a in sys.argv[1:] if a != "--native"]
    length = int(float(given[0])) if given else 100_000_000
    sys.exit(native(length) if "--native" in sys.argv else main(length))
