# SPDX-License-Identifier: Apache-2.0
"""A robot that is read for a long time: memory, and what a blocked Python costs.

python benchmarks/live_endurance.py [MINUTES [STALLS [WARM]]]

An arm of its own process moves without a touch and sends 500 samples a second over RTDE. For
MINUTES (default 4) `touchline live` reads it with page and recorder, and so does the node with a
recorder, where ROS 2 is there: the slope of their resident memory, after WARM minutes more (default
1), in which libraries take what they keep. Before that Python is blocked STALLS times (default 20)
for 0.3 s, and collects three million objects: the longest time between two processed samples,
beside that of an idle Python.
"""

import contextlib
import ctypes
import gc
import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from live_faults import Peer, write_motion

STALL, RATE = 0.3, 500.0  # s, Hz
OBJECTS = 3_000_000
PAGE = 4096  # bytes


def stalls(arm, address: str, aside: bool, count: int) -> None:
    """Prints the longest gaps between processed samples: Python idles, is held, collects."""
    from touchline.live.aside import ReadAside
    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source

    hold = ctypes.PyDLL(None).usleep  # keeps the interpreter's lock
    source = ReadAside(address, arm, ("rtde",), 1.0 / RATE) if aside else make_source(address, arm)
    gaps = {"idle": [], "held": [], "collects": []}
    with Session(arm, Connection(source), force=True) as session:
        session.start()
        news = session.run()
        first = _follow(news, 0.5)
        runner = source._felt.runner
        stream, begin = session.connection.streams[0], session.samples
        objects = [[] for _ in range(OBJECTS)]
        for _ in range(count):
            for kind, longest in gaps.items():
                _follow(news, 0.2)
                runner.longest_gap()
                if kind == "idle":
                    _follow(news, STALL)
                elif kind == "held":
                    hold(round(1e6 * STALL))
                else:
                    gc.collect()
                longest.append(runner.longest_gap())
        _follow(news, 0.5)
        lost, found = stream.lost, session.samples - begin
        del objects, first
    name = "read aside, as ros2:// and franka://" if aside else "ur://, native threads"
    print(f"{name}: {found} samples, {lost} lost, {runner.overrun} without room")
    for kind, values in gaps.items():
        ms = 1e3 * np.array(values)
        median, most = np.percentile(ms, (50, 90))
        words = f"median {median:5.1f} ms, of 90 % {most:5.1f} ms, of all {ms.max():6.1f} ms"
        print(f"  {kind:9} longest gap: {words}")


def _follow(news, seconds: float) -> None:
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        next(news)


def memory(folder: Path, address: str, minutes: float, warm_minutes: float) -> None:
    """Prints the slope of the resident memory of `touchline live` and of the node.

    All of it, and what the process has asked for itself. The rest are pages of files, libraries
    above all: Linux takes them away and brings them back as memory on the machine gets short.
    """
    robot = str(folder / "robot.yaml")
    live = ["live", "--robot", robot, "--source", address, "--force", "--view", "--no-browser"]
    commands = {"page and recorder": ["touchline", *live, "--record", str(folder / "log.mcap")]}
    if importlib.util.find_spec("rclpy") is not None:
        parameters = {"robot": robot, "source": address, "force": "true"}
        parameters["record"] = str(folder / "node.parquet")
        pairs = [x for k, v in parameters.items() for x in ("-p", f"{k}:={v}")]
        commands["node and recorder"] = ["touchline.live.node", "--ros-args", *pairs]
    with contextlib.ExitStack() as kept:
        running = {}
        for name, command in commands.items():
            process = subprocess.Popen(
                [sys.executable, "-m", *command], stdout=-3, stderr=-3, env=os.environ
            )
            kept.callback(process.wait)
            kept.callback(process.terminate)
            running[name] = process.pid
        times: list[float] = []
        sizes: dict[str, list[tuple[float, float]]] = {name: [] for name in running}
        end = time.monotonic() + 60.0 * (warm_minutes + minutes)
        while (now := time.monotonic()) < end:
            times.append(now)
            for name, pid in running.items():
                sizes[name].append(_resident(pid))
            time.sleep(1.0)
        written = {
            "page and recorder": (folder / "log.mcap").stat().st_size,
            "node and recorder": sum(
                part.stat().st_size for part in folder.glob("node.*/*.parquet")
            ),
        }
    seconds = np.array(times) - times[0]
    warm = seconds > 60.0 * warm_minutes
    hours = seconds[warm] / 3600.0
    for name, values in sizes.items():
        print(f"{name}, over {60 * np.ptp(hours):.1f} min; {written[name] / 1e6:.1f} MB recorded")
        A = np.column_stack([hours - hours.mean(), np.ones(len(hours))])
        kinds = zip(("resident", "of its own"), np.array(values)[warm].T / 1e6, strict=True)
        for kind, megabytes in kinds:
            (slope, mean), *_ = np.linalg.lstsq(A, megabytes, rcond=None)
            series = " ".join(f"{x:.1f}" for x in megabytes[:: max(len(megabytes) // 6, 1)])
            print(
                f"  {kind:10} {mean:.1f} MB, {slope:+.2f} MB an hour, "
                f"{megabytes[-1] - megabytes[0]:+.2f} MB from first to last; {series}"
            )


def _resident(pid: int) -> tuple[float, float]:
    """Bytes: all, and those that are no pages of files."""
    all_of, shared = map(int, Path(f"/proc/{pid}/statm").read_text().split()[1:3])
    return all_of * PAGE, (all_of - shared) * PAGE


def main() -> None:
    """Prints all of it."""
    from live_arms import make_arm

    minutes = float(sys.argv[1]) if len(sys.argv) > 1 else 4.0
    count = int(sys.argv[2]) if len(sys.argv) > 2 else 20
    warm_minutes = float(sys.argv[3]) if len(sys.argv) > 3 else 1.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        arm = make_arm(folder, 6)
        write_motion(folder / "motion.npz", arm)
        peer = Peer(folder / "motion.npz")
        try:
            address = f"ur://127.0.0.1:{peer.port}"
            if count > 0:
                stalls(arm, address, False, count)
                stalls(arm, address, True, count)
            if minutes > 0.0:
                memory(folder, address, minutes, warm_minutes)
        finally:
            peer.kill()
    print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
