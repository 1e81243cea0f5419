# SPDX-License-Identifier: Apache-2.0
"""Faults of the link of a running robot: told how soon, withheld, found again, and no event.

python benchmarks/live_faults.py [RUNS] [FAULT ...]

A UR arm of its own process moves without a touch and sends 500 samples a second over RTDE; `topic`
is an arm on ROS 2 topics and needs touchline[ros2]. Each fault is put in RUNS times (default 5),
2 s apart. The command prints for each fault: how long until it was told, how long from the peer's
return until the next sample, in how many runs 20 and 100 ms were kept, an estimate that was not
withheld, samples lost and refused beside those that were, and events. One run takes some 2.5 s.
"""

import contextlib
import os
import random
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

TESTS = Path(__file__).resolve().parents[1] / "tests" / "live"
sys.path[:0] = [str(TESTS)]
RATE = 500.0  # Hz
SETTLE = 1.2  # s between two faults, in which the observer settles and nothing may happen
TOLD, BACK = 0.020, 0.100  # s: the goals
WITHHELD = 0.020  # s without a sample, after which there may be no estimate
AWAY = 0.5  # s for which a controller is gone
TAMPERED = 0.8  # s for which packages are tampered with
SHARE = 0.01  # of the packages that are dropped, doubled or swapped
LATE = 0.020  # s
# What stands for the robot has a higher real-time priority than those who read it (10), or else
# such a niceness, where this user may have it.
PARTNER, ELSE = 20, -15
FAULTS = {
    "pause 0.3": "pause 0.3",
    "pause 0.8": "pause 0.8",
    "pause 1.5": "pause 1.5",
    "restart": "",
    "dropped": "tamper drop",
    "doubled": "tamper double",
    "reordered": "tamper swap",
    "delayed": "tamper delay",
    "clock +3 s": "clock 3",
    "clock -0.5 s": "clock -0.5",
    "clock -30 s": "clock -30",
    "topic": "",
}
# Faults of single samples are counted, and change no state below 5 %.
COUNTED = {"dropped", "doubled", "reordered"}


class Tamper:
    """What happens to packages on their way; counts what it did."""

    def __init__(self, kind: str) -> None:
        self.kind, self.lost, self.refused = kind, 0, 0
        self._random, self._held = random.Random(7), []

    def __call__(self, due: list) -> list:
        """The packages that go on."""
        if self.kind == "delay":
            now = time.monotonic()
            self._held += [(now + LATE, package) for package in due]
            ready = [package for at, package in self._held if at <= now]
            self._held = [entry for entry in self._held if entry[0] > now]
            return ready
        found = []
        for package in due:
            hit = self._random.random() < SHARE
            if self._held:  # swapped: behind the next one
                found += [package, *self._held]
                self._held = []
            elif not hit:
                found.append(package)
            elif self.kind == "drop":
                self.lost += 1
            elif self.kind == "double":
                found += [package, package]
                self.refused += 1
            else:
                self._held = [package]
                self.refused += 1
                self.lost += 1  # as the next one comes first
        return found

    def rest(self) -> list:
        """Packages that it still holds."""
        return [entry[1] if self.kind == "delay" else entry for entry in self._held]


def serve(port: int, path: str) -> None:
    """The controller's process: obeys lines of standard input, tells times on standard output."""
    try:  # a robot is in time, however busy this machine is
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(PARTNER))
    except OSError:
        with contextlib.suppress(OSError):
            os.nice(ELSE)
    from types import SimpleNamespace

    from fake_rtde import FakeController

    class Samples(SimpleNamespace):
        def __len__(self) -> int:
            return len(self.q)

    controller = FakeController(Samples(**np.load(path)), port=port)

    def tell(word: str, *counts: int, at: float | None = None) -> None:
        print(word, repr(at or time.monotonic()), *counts, flush=True)

    print("port", controller.port, flush=True)
    tell("on", 0, 0)
    for line in sys.stdin:
        kind, argument = line.split()
        before = time.monotonic()  # whoever sees the fault sees it later, whatever runs in between
        if kind == "pause":
            controller.paused.set()
            tell("off", at=before)
            time.sleep(float(argument))
            controller.paused.clear()
            tell("on", 0, 0)
        elif kind == "clock":
            tell("off", at=before)
            controller.clock += float(argument)
            tell("on", 0, 0)
        else:
            tamper = Tamper(argument)
            tell("off", at=before)
            controller.tamper = tamper
            time.sleep(TAMPERED)
            kept = controller.tamper

            def once(due: list, kept: Tamper = kept) -> list:
                controller.tamper = lambda due: due
                return kept.rest() + due if kept.kind == "delay" else due

            controller.tamper = once
            tell("on", tamper.lost + len(tamper.rest()) * (tamper.kind == "drop"), tamper.refused)


def _arm(folder: Path):
    from live_arms import make_arm

    return make_arm(folder, 6)


def write_motion(path: Path, arm) -> None:
    """A motion that repeats after a minute, with noise; nothing touches the arm."""
    from make_long_log import loads

    time = np.arange(60 * 1000)[:, None] * 1e-3
    w = 2 * np.pi * np.array([5, 7, 9, 8, 11, 12]) / 60
    q, qd = 0.4 * np.sin(w * time), 0.4 * w * np.cos(w * time)
    signals = dict(zip(("tau", "wrench"), loads(arm, q, qd), strict=True))
    signals |= {"q": np.roll(q, -1, axis=0), "qd": np.roll(qd, -1, axis=0)}
    rng = np.random.default_rng(0)
    sigmas = {"q": 0.0, "qd": 2e-4, "tau": 0.05, "wrench": [0.05, 0.05, 0.05, 0.01, 0.01, 0.01]}
    every = round(1000.0 / RATE)
    for name, values in signals.items():
        signals[name] = (values + rng.normal(size=values.shape) * sigmas[name])[::every]
    np.savez(path, **signals)


class Peer:
    """The controller's process, and when what happened to it."""

    def __init__(self, motion: Path, port: int = 0) -> None:
        command = [sys.executable, __file__, "--serve", str(port), str(motion)]
        pipe = subprocess.PIPE
        self.process = subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True)
        assert self.process.stdout is not None
        self.off, self.on = np.nan, np.nan
        self.lost = self.refused = 0
        self.port = int(self.process.stdout.readline().split()[1])
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            word, at, *counts = line.split()
            if word == "off":
                self.off, self.on = float(at), np.nan
            else:
                self.on = float(at)
                self.lost, self.refused = int(counts[0]), int(counts[1])

    def ask(self, line: str) -> None:
        """Lets a fault happen."""
        assert self.process.stdin is not None
        self.off = self.on = np.nan
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()

    def kill(self) -> None:
        """Ends it without a farewell."""
        self.process.kill()
        self.process.wait()


@dataclass
class Seen:
    """What was seen of one fault; times in s, NaN where it was not."""

    told: float = np.nan
    back: float = np.nan
    honest: bool = True  # was there no estimate while the stream was stale?
    lost: tuple[int, int] = (0, 0)  # as told, as it was
    refused: tuple[int, int] = (0, 0)


@dataclass
class Watch:
    """A session in a thread of its own, and what happened in it."""

    session: object
    arrivals: list = field(default_factory=list)
    notices: list = field(default_factory=list)
    estimates: list = field(default_factory=list)  # (when, whether there is one), at changes
    ended: threading.Event = field(default_factory=threading.Event)

    def follow(self) -> None:
        """Runs until it is told to end."""
        session, last = self.session, 0.0
        for _ in session.run():
            if session.sample is not None and session.sample.arrival != last:
                last = session.sample.arrival
                self.arrivals.append(last)
            self.notices += session.notices()
            known = session.result is not None
            if not self.estimates or self.estimates[-1][1] != known:
                self.estimates.append((time.monotonic(), known))
            if self.ended.is_set():
                return

    def judge(self, off: float, on: float) -> Seen:
        """What was seen of a fault that lasted from `off` to `on`."""
        seen = Seen()
        bad = [n for n in self.notices if n.at >= off and (n.state != "ok" or "set back" in n.text)]
        if bad:
            seen.told = bad[0].at - off
        after = next((at for at in self.arrivals if at > on), np.nan)
        seen.back = after - on
        stale = [n.at for n in bad if n.state == "stale" and n.at < on]
        if stale:
            arrivals = np.array(self.arrivals)
            known = [at for at, is_known in self.estimates if is_known and stale[0] < at < after]
            seen.honest = all(at - arrivals[arrivals <= at][-1] < WITHHELD for at in known)
        return seen


def run(fault: str, runs: int) -> tuple[list[Seen], int]:
    """What was seen of the faults, and the number of events."""
    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source

    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as kept:
        arm, motion = _arm(Path(folder)), Path(folder) / "motion.npz"
        write_motion(motion, arm)
        peer = [Peer(motion)]
        kept.callback(lambda peers: peers[0].kill(), peer)
        connection = Connection(make_source(f"ur://127.0.0.1:{peer[0].port}", arm))
        session = kept.enter_context(Session(arm, connection, force=True))
        session.start()
        watch = Watch(session)
        thread = threading.Thread(target=watch.follow)
        thread.start()
        kept.callback(thread.join)
        kept.callback(watch.ended.set)
        time.sleep(SETTLE)
        found = []
        stream = connection.streams[0]
        for _ in range(runs):
            lost, refused = stream.lost, stream.refused
            if fault == "restart":
                off, port = time.monotonic(), peer[0].port
                peer[0].kill()
                time.sleep(AWAY)
                peer[0] = Peer(motion, port)
                on = _time_of(lambda: peer[0].on)
            else:
                peer[0].ask(FAULTS[fault])
                off, on = _time_of(lambda: peer[0].off), _time_of(lambda: peer[0].on)
            time.sleep(SETTLE)
            seen = watch.judge(off, on)
            seen.lost = (stream.lost - lost, peer[0].lost)
            seen.refused = (stream.refused - refused, peer[0].refused)
            found.append(seen)
        events = session.pipeline.events
        for event in events:
            print(f"  {fault}: event {event.link} {event.level} at {event.detected:.3f} s")
        return found, len(events)


def run_topic(runs: int) -> tuple[list[Seen], int]:
    """The wrenches' topic falls silent for 0.5 s in every other second."""
    from live_arms import write_arm

    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source
    from touchline.model.robot import load_robot

    with tempfile.TemporaryDirectory() as folder, contextlib.ExitStack() as kept:
        path = write_arm(Path(folder), 6)
        paths = [str(TESTS), str(TESTS.parent), os.environ.get("PYTHONPATH", "")]
        env = os.environ | {"PYTHONPATH": os.pathsep.join(paths)}
        seconds = 2.0 * runs + 8.0
        command = [sys.executable, str(TESTS / "ros_publisher.py"), str(path), str(seconds)]
        process = kept.enter_context(
            subprocess.Popen([*command, "nowrench", "marks"], env=env, stdout=-1, text=True)
        )
        kept.callback(process.kill)
        marks: list[tuple[str, float]] = []

        def listen() -> None:
            for line in process.stdout or ():
                word, *at = line.split()
                marks.extend((word, float(x)) for x in at)

        threading.Thread(target=listen, daemon=True).start()
        arm = load_robot(path)
        session = kept.enter_context(Session(arm, Connection(make_source("ros2://", arm))))
        session.start()
        watch = Watch(session)
        watched = threading.Thread(target=watch.follow)
        watched.start()
        kept.callback(watched.join)
        kept.callback(watch.ended.set)
        time.sleep(max(seconds - 9.0, 2.0))
        found = []
        for word, at in list(marks):
            bad = [n for n in watch.notices if n.at >= at and n.stream == "wrist"]
            if word == "silent" and at > watch.arrivals[0] + SETTLE and bad:
                found.append(Seen(told=next(n.at for n in bad if n.state != "ok") - at))
            elif word == "speaks" and found:
                good = [n.at for n in bad if n.state == "ok"]
                found[-1].back = good[0] - at if good else np.nan
        return found, len(session.pipeline.events)


def _time_of(value) -> float:
    end = time.monotonic() + 30.0
    while np.isnan(value()) and time.monotonic() < end:
        time.sleep(0.005)
    return value()


def row(fault: str, found: list[Seen], events: int) -> str:
    """One line of the table."""
    told, back = (np.array([getattr(s, name) for s in found]) for name in ("told", "back"))
    cells = [f"{fault:13}", f"{len(found):4}"]
    for times, goal in ((told, TOLD), (back, BACK)):
        if fault in COUNTED or np.isnan(times).all():
            cells.append(f"{'-':>20}")
            continue
        kept = int(np.sum(times <= goal))
        largest = 1e3 * np.nanmax(times)
        cells.append(f"{1e3 * np.nanmedian(times):6.1f} {largest:7.1f} {kept:5}")
    cells.append(f"{sum(s.honest for s in found):8}")
    for name in ("lost", "refused"):
        pairs = [getattr(s, name) for s in found]
        cells.append(f"{sum(p[0] for p in pairs):6} of {sum(p[1] for p in pairs):4}")
    return "  ".join([*cells, f"{events:6}"])


def main() -> None:
    """Prints the table."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    faults = sys.argv[2:] or list(FAULTS)
    print("                      told [ms]             back [ms]")
    print(
        "fault          runs     p50     max  <=20     p50     max <=100  withheld"
        "     lost  (true)  refused(true)  events"
    )
    for fault in faults:
        found, events = run_topic(runs) if fault == "topic" else run(fault, runs)
        print(row(fault, found, events) if found else f"{fault}: nothing was seen", flush=True)
    print(f"load of this machine: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--serve"]:
        serve(int(sys.argv[2]), sys.argv[3])
    else:
        main()
