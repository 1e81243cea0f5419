# SPDX-License-Identifier: Apache-2.0
"""`touchline bench logs`."""

import os
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.logs.files import serialized, write_mcap, write_sqlite
from touchline.bench.tables import Row, aligned
from touchline.localizer.skin import Skin
from touchline.logs import open_log, write_table
from touchline.memory import peak_megabytes
from touchline.model.robot import Robot, load_robot
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples
from touchline.trials.touches import TouchSampler, touch_loads
from touchline.workers import workers

ROBOT = "sara-full"
ROUNDS = 3
SLOW = 10  # peers that decode one by one read so many times fewer messages
RATE = 1000.0  # Hz
TOUCH_EVERY, TOUCH_LASTS, TOUCH_FORCE = 10.0, 0.5, 25.0  # s, s, N
STEP = 25  # samples between which the load of a touch is straight
NOISE = 0.01  # Nm, N
HOUR_SENSORS = 2  # force-torque sensors of the arm whose hour is analyzed
HOUR = {"none": (15.0, None), "full": (30.0, 20.0)}  # s of CPU, of the clock, that it may take


def main(samples: int, minutes: float) -> int:
    """Print what reading and analyzing cost, in CPU time of one process."""
    robot = load_robot(ROBOT)
    with tempfile.TemporaryDirectory(prefix="touchline-bench-") as name:
        folder = Path(name)
        print(_readers(folder, robot, motion(robot, samples)), flush=True)
        if minutes > 0:
            print(_analysis(folder, _with_sensors(robot, HOUR_SENSORS), minutes))
    return 0


def motion(robot: Robot, count: int, touched: bool = False) -> Samples:
    """A slow motion with exact loads and little noise, touched every ten seconds or not at all."""
    rng = np.random.default_rng(0)
    time = 1.7e9 + np.arange(count) / RATE
    low, high = robot.ranges
    pace, phase = rng.uniform(0.2, 0.6, len(low)), rng.uniform(0, 2 * np.pi, len(low))
    angle = pace * (time[:, None] - time[0]) + phase
    swing = 0.2 * (high - low)
    q, qd = 0.5 * (low + high) + swing * np.sin(angle), swing * pace * np.cos(angle)
    n, k = len(robot.joint_names), len(robot.sensor_names)
    # An observer without lag that is told nothing takes all that moves the arm for external.
    observer = Observer(robot, bandwidth=1e9, method="paper", discretization="exponential")
    found = observer.run(time, q, qd, np.zeros((count, n)), np.zeros((count, k, 6)))
    tau = np.nan_to_num(found.tau_ext) + rng.normal(0, NOISE, (count, n))
    wrench = np.nan_to_num(found.sensor_wrench) + rng.normal(0, NOISE, (count, k, 6))
    if touched:
        _touch(robot, rng, q, tau, wrench)
    return Samples(time, q, qd, tau, wrench)


def _with_sensors(robot: Robot, count: int) -> Robot:
    """The robot with its first force-torque sensors alone."""
    description = replace(robot.description, sensors=robot.description.sensors[:count])
    return Robot(description, robot.mechanism, robot.assumed)


def _touch(robot: Robot, rng: np.random.Generator, q: Any, tau: Any, wrench: Any) -> None:
    """Add touches of random points of the arm to its readings."""
    sampler = TouchSampler(Skin(robot), rng)
    n, length = tau.shape[1], int(TOUCH_LASTS * RATE)
    for start in range(int(RATE * TOUCH_EVERY / 2), len(q) - length, int(RATE * TOUCH_EVERY)):
        touch = next(filter(None, (sampler.attempt(TOUCH_FORCE, q[start]) for _ in range(1000))))
        T = robot.T_world_links(q[start])[touch.patch.link]
        point = T[:3, :3].T @ (touch.position - T[:3, 3])
        force = T[:3, :3].T @ touch.force
        knots = np.arange(0, length + STEP, STEP)
        loads = []
        for at in knots:
            here = q[min(start + at, len(q) - 1)]
            T = robot.T_world_links(here)[touch.patch.link]
            place = T[:3, :3] @ point + T[:3, 3]
            loads.append(touch_loads(robot, here, touch.patch.node, place, T[:3, :3] @ force))
        rows = np.arange(length)
        between = np.stack([np.interp(rows, knots, load) for load in np.array(loads).T], axis=1)
        tau[start : start + length] -= between[:, :n]
        wrench[start : start + length] -= between[:, n:].reshape(length, -1, 6)


def _least(work: Callable[[], int]) -> float:
    """Items a second of CPU time, the best of some rounds."""
    best = 0.0
    for _ in range(ROUNDS):
        began = time.process_time()
        count = work()
        best = max(best, count / (time.process_time() - began))
    return best


def _readers(folder: Path, robot: Robot, samples: Any) -> str:
    messages = serialized(robot, samples)
    files: dict[str, Path] = {}
    for compression in ("zstd", "lz4", ""):
        files[f"MCAP {compression or 'plain'}"] = folder / f"{compression or 'plain'}.mcap"
        write_mcap(files[f"MCAP {compression or 'plain'}"], messages, compression, True)
    files["MCAP zstd, no summary"] = folder / "unfinished.mcap"
    write_mcap(files["MCAP zstd, no summary"], messages, "zstd", False)
    files["rosbag2 sqlite3"] = folder / "bag.db3"
    write_sqlite(files["rosbag2 sqlite3"], messages)
    rows: list[Row] = [("read by", "file", "million messages/s of CPU")]
    for name, path in files.items():
        rate = _least(lambda path=path: _read(path, robot) * len(messages.tables))
        rows.append(("touchline, to samples", name, f"{1e-6 * rate:.3f}"))
    rows += _peers(files, messages.count)
    table = folder / "log.csv"
    write_table(table, samples, robot.description)
    cells = table.stat().st_size
    text: list[Row] = [("read by", "file", "MB/s of CPU")]
    rate = _least(lambda: _read(table, robot) and cells)
    text.append(("touchline, to samples", "CSV", f"{1e-6 * rate:.0f}"))
    text.append(("pyarrow, to a table", "CSV", f"{1e-6 * _least(lambda: _arrow_csv(table)):.0f}"))
    packed = folder / "log.parquet"
    write_table(packed, samples, robot.description)
    with open_log(packed, robot.description) as log:
        numbers = 8 * len(samples) * len(log.columns)
    rate = _least(lambda: _read(packed, robot) and numbers)
    text.append(("touchline, to samples", "Parquet", f"{1e-6 * rate:.0f}"))
    rate = _least(lambda: _arrow_parquet(packed) and numbers)
    text.append(("pyarrow, to a table", "Parquet", f"{1e-6 * rate:.0f}"))
    return f"{aligned(rows, (0, 1))}\n\n{aligned(text, (0, 1))}"


def _read(path: Path, robot: Robot) -> int:
    with open_log(path, robot.description) as log:
        return sum(len(samples) for samples in log.chunks())


def _arrow_csv(path: Path) -> int:
    import pyarrow.csv

    options = pyarrow.csv.ReadOptions(use_threads=False)
    pyarrow.csv.read_csv(path, read_options=options)
    return path.stat().st_size


def _arrow_parquet(path: Path) -> int:
    import pyarrow.parquet

    return pyarrow.parquet.read_table(path, use_threads=False).num_rows


def _peers(files: dict[str, Path], count: int) -> list[Row]:
    """What other packages take to hand out the bytes alone, and rosbags to decode them."""
    from rosbags.rosbag2 import Reader
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)

    def raw(path: Path) -> int:
        with Reader(path) as reader:
            return sum(1 for _ in reader.messages())

    def decoded(path: Path) -> int:
        with Reader(path) as reader:
            for number, (connection, _, data) in enumerate(reader.messages()):
                store.deserialize_cdr(data, connection.msgtype)
                if number >= count // SLOW:
                    return number
        return count

    def mcap(path: Path) -> int:
        from mcap.reader import make_reader  # pyright: ignore[reportMissingImports]

        with path.open("rb") as stream:
            return sum(1 for _ in make_reader(stream).iter_messages())

    rows = []
    for name in ("MCAP zstd", "rosbag2 sqlite3"):
        for words, read in (("bytes alone", raw), ("decoded", decoded)):
            rate = _least(partial(read, files[name]))
            rows.append((f"rosbags, {words}", name, f"{1e-6 * rate:.3f}"))
    if find_spec("mcap") is not None:
        rate = _least(lambda: mcap(files["MCAP zstd"]))
        rows.append(("mcap, bytes alone", "MCAP zstd", f"{1e-6 * rate:.3f}"))
    return rows


def _analysis(folder: Path, robot: Robot, minutes: float) -> str:
    samples: Any = motion(robot, int(60 * minutes * RATE), touched=True)
    log = folder / "long.parquet"
    write_table(log, samples, robot.description)
    hours = len(samples) / RATE / 3600
    head = ("CPU s", "per hour", "goal", "clock s", "per hour", "goal")
    rows: list[Row] = [("analyze --report", "events", *head, "memory MB")]
    for report, (most, longest) in HOUR.items():
        # A process of its own, so that its memory and start are counted.
        with workers(1) as pool:
            done = pool.submit(_analyzed, str(log), robot, str(folder / report), report)
            events, spent, clock, memory = done.result()
        cpu = (f"{spent:.2f}", f"{spent / hours:.1f}", f"{most:g}")
        wall = (f"{clock:.2f}", f"{clock / hours:.1f}", "" if longest is None else f"{longest:g}")
        rows.append((report, str(events), *cpu, *wall, str(memory)))
    touches, joints = int(60 * minutes / TOUCH_EVERY), len(robot.joint_names)
    what = f"{minutes:g} minutes at 1 kHz, {touches} touches, {joints} joints"
    sensors = f"{len(robot.sensor_names)} sensors; {os.cpu_count()} cores"
    return f"\n{what}, {sensors}\n{aligned(rows)}"


def _analyzed(log: str, robot: Robot, out: str, report: Any) -> tuple[int, float, float, int]:
    from touchline.report.analysis import analyze

    began, clock = time.process_time(), time.perf_counter()
    analysis = analyze(log, robot, out, report=report)
    spent, clock = time.process_time() - began, time.perf_counter() - clock
    return len(analysis.events), spent, clock, peak_megabytes()
