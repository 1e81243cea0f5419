# SPDX-License-Identifier: Apache-2.0
"""What a run would do and how long it would take, without doing it."""

import os
from dataclasses import dataclass, replace
from pathlib import Path

from touchline.errors import InputError
from touchline.fleet.figures import HOUR
from touchline.fleet.manifest import MANIFEST, Manifest
from touchline.fleet.plan import Plan, Recording, briefly, none_text
from touchline.logs.log import open_log
from touchline.logs.source import HEAD_ROWS
from touchline.model.description import RobotDescription
from touchline.model.robot import load_robot
from touchline.numbers import counted, lasting

# CPU time for an hour at 1 kHz, touched every ten seconds: `touchline bench logs`, rounded up [s].
CPU = {"none": 40.0, "summary": 45.0, "full": 70.0}


@dataclass(frozen=True)
class Forecast:
    """What is known of recordings beforehand.

    Attributes:
        plan: with what was found to be wrong when they were opened.
        none: what was named and is no recording, with the reason.
        durations: name -> [s], of those of which it can be told without reading all.
        cost: CPU time for a second of a recording [s].
        measured: number of recordings that `cost` is from; 0: from the benchmark.
        workers: number of processes.
        failing: names of those that a run would try in vain.
    """

    plan: list[Recording]
    none: dict[str, str]
    durations: dict[str, float]
    cost: float
    measured: int
    workers: int
    failing: frozenset[str] = frozenset()

    @property
    def todo(self) -> list[Recording]:
        """Those that would be analyzed."""
        return [recording for recording in self.plan if not recording.problem]

    @property
    def seconds(self) -> float:
        """By the clock: no sooner than the longest, and those of unknown length by their size."""
        known = [r for r in self.todo if r.name in self.durations]
        told = sum(self.durations[r.name] for r in known)
        size = sum(r.size for r in known)
        rest = sum(r.size for r in self.todo if r.name not in self.durations)
        if size:
            told += told / size * rest
        longest = max((self.durations[r.name] for r in known), default=0.0)
        return self.cost * max(told / self.workers, longest)


def forecast(plan: Plan, out: Path, report: str, workers: int) -> Forecast:
    """Open all recordings that are on this machine, and look at their beginnings.

    Args:
        plan: of `make_plan`.
        out: folder of the results; what earlier runs took there tells how long it takes.
        report: option of the analysis.
        workers: number of processes; 0: one per core.
    """
    robots: dict[str, RobotDescription | str] = {}  # or why it cannot be loaded
    looked, durations, failing = [], {}, set()
    for recording in plan:
        problem = recording.problem
        robot = "" if problem else _robot(recording.robot, robots)
        if isinstance(robot, str):
            problem = problem or robot
        elif not recording.url:
            try:
                duration = _duration(recording, robot)
                if duration is not None:
                    durations[recording.name] = duration
            except InputError as error:
                problem = error.problems[0]
            except OSError as error:
                problem = f"{error.filename or recording.source}: {error.strerror or error}"
            if problem:
                failing.add(recording.name)
        looked.append(replace(recording, problem=problem))
    rows = Manifest(out).rows.values() if (out / MANIFEST).is_file() else ()
    done = [row for row in rows if row.get("duration") and row.get("cpu_seconds")]
    cost = CPU[report] / HOUR
    if done:
        cost = sum(row["cpu_seconds"] for row in done) / sum(row["duration"] for row in done)
    processes = min(workers or os.cpu_count() or 1, max(len(plan), 1))
    return Forecast(looked, plan.none, durations, cost, len(done), processes, frozenset(failing))


def _robot(name: str, robots: dict[str, RobotDescription | str]) -> RobotDescription | str:
    if name not in robots:
        try:
            robots[name] = load_robot(name).description
        except InputError as error:
            robots[name] = error.problems[0]
    return robots[name]


def _duration(recording: Recording, robot: RobotDescription) -> float | None:
    """Of a recording [s]; of plain text about, from the size of its first rows."""
    with open_log(recording.log, robot) as log:
        if log.duration is not None:
            return log.duration
        if recording.log.suffix.lower() != ".csv":
            return None
        first = next(log.chunks(HEAD_ROWS), None)
    if first is None or len(first) < 2:
        return None
    with recording.log.open("rb") as file:
        head = len(file.readline())
        size = sum(len(file.readline()) for _ in range(len(first)))
    period = float(first.time[-1] - first.time[0]) / (len(first) - 1)
    return max(period, 0.0) * (recording.size - head) * len(first) / size


def forecast_text(told: Forecast) -> str:
    """A line for each recording, and a line of sums."""
    lines = none_text(told.none)
    for recording in told.plan:
        length = "?"
        if recording.name in told.durations:
            length = f"{told.durations[recording.name] / HOUR:.3f}"
        words = f"  with {recording.robot}"
        if recording.problem:
            words, length = f"  ({briefly(recording.problem, recording.source)})", ""
        verb = "skip" if recording.problem else "analyze"
        verb = "fail" if recording.name in told.failing else verb
        lines.append(
            f"{verb:8}{recording.size / 1e6:9.1f} MB {length:>8} h  {recording.name}{words}"
        )
    unknown = sum(r.name not in told.durations for r in told.todo)
    known = sum(told.durations.get(r.name, 0.0) for r in told.todo)
    size = sum(r.size for r in told.todo) / 1e6
    lines.append(
        f"{len(told.todo)} of {counted(len(told.plan), 'recording')}, {lasting(known)}"
        + (f" and {unknown} of unknown length" if unknown else "")
        + f", {size:.1f} MB"
    )
    before = f"as {counted(told.measured, 'recording')} before"
    source = before if told.measured else "as of an arm at 1 kHz"
    lines.append(
        f"about {lasting(max(told.seconds, 1.0))} with {counted(told.workers, 'process', 'es')} "
        f"({told.cost * HOUR:.0f} s of CPU an hour, {source}); nothing was done"
    )
    return "\n".join(lines)
