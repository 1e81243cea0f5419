# SPDX-License-Identifier: Apache-2.0
"""Many fault runs on several processes; what is done is kept, and another start goes on."""

import hashlib
import json
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import as_completed
from dataclasses import dataclass, fields
from functools import partial
from pathlib import Path
from typing import TypeVar

import numpy as np

import touchline
from touchline.bench.reliability.judge import Outcome, judge, listen
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.faults import FAULTS, LONGEST, Channel, FaultType, cases_of, channels_of
from touchline.trials.recordings import PHASES, record, robot_named
from touchline.workers import workers

SECONDS = max(PHASES.values()) + LONGEST + 0.1  # of a recording: each fault ends in it
_P = TypeVar("_P")
_R = TypeVar("_R")
NUMBERS = tuple(
    field.name for field in fields(Outcome) if field.name not in ("robot", "fault", "channel")
)


@dataclass(frozen=True)
class Part:
    """Fault runs on one recording.

    Attributes:
        robot: its name.
        seed: of its motion and its push.
        share: of its cases, drawn at random; 1: all.
    """

    robot: str
    seed: int
    share: float

    def cases(self, robot: Robot) -> list[tuple[FaultType, Channel, tuple[str, float]]]:
        """Faults, channels and phases that are drawn."""
        rng = np.random.default_rng([self.seed, 12])
        return [
            (fault, channel, phase)
            for fault, channel in cases_of(robot)
            for phase in PHASES.items()
            if rng.random() < self.share
        ]


class Kept:
    """Outcomes in a folder: a file for each recording, a line for each run.

    Raises:
        InputError: the folder holds runs of another build.
    """

    def __init__(self, folder: Path) -> None:
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        note, build = folder / "build.txt", build_of()
        if not note.exists():
            note.write_text(build + "\n")
        elif note.read_text().strip() != build:
            raise InputError(f"{folder}: its runs are of another build; name a new folder")

    def file(self, part: Part) -> Path:
        """That of a recording."""
        return self.folder / f"{part.robot}-{part.seed}.jsonl"

    def read(self, part: Part, robot: Robot) -> dict[tuple[str, str, str], Outcome]:
        """What is done of a recording; a line that was cut off counts for nothing."""
        path, found = self.file(part), {}
        channels = {channel.name: channel for channel in channels_of(robot)}
        faults = {fault.name: fault for fault in FAULTS}
        for line in path.read_text().splitlines() if path.exists() else ():
            try:
                row = json.loads(line)
            except ValueError:
                continue
            fault, channel = faults[row.pop("fault")], channels[row.pop("channel")]
            found[fault.name, channel.name, row["phase"]] = Outcome(
                part.robot, fault, channel, **row
            )
        return found

    def add(self, part: Part, outcome: Outcome) -> None:
        """Keeps one run."""
        row = {name: getattr(outcome, name) for name in NUMBERS}
        row |= {"fault": outcome.fault.name, "channel": outcome.channel.name}
        path = self.file(part)
        cut_off = path.exists() and path.read_bytes()[-1:] not in (b"", b"\n")
        with path.open("a") as file:
            file.write("\n" * cut_off + json.dumps(row) + "\n")


def build_of() -> str:
    """Tells builds apart: of the core and of all of the package's code."""
    digest = hashlib.sha256()
    root = Path(touchline.__file__).parent
    for path in [Path(core.__file__), *sorted(root.rglob("*.py"))]:
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def run_part(part: Part, folder: Path | None) -> list[Outcome]:
    """All fault runs of one recording; those that `folder` has are not run again."""
    robot = robot_named(part.robot)
    kept = Kept(folder) if folder is not None else None
    done = kept.read(part, robot) if kept is not None else {}
    found: list[Outcome] = []
    pipeline = recording = healthy = None
    for fault, channel, phase in part.cases(robot):
        outcome = done.get((fault.name, channel.name, phase[0]))
        if outcome is None:
            if pipeline is None:
                pipeline = Pipeline(robot)
                recording = record(robot, part.seed, seconds=SECONDS)
                healthy = listen(pipeline, recording.samples)
            assert recording is not None and healthy is not None
            outcome = judge(pipeline, recording, healthy, fault, channel, phase)
            if kept is not None:
                kept.add(part, outcome)
        found.append(outcome)
    return found


def run_all(parts: Sequence[Part], folder: Path | None, processes: int) -> Iterator[Outcome]:
    """Of all recordings, on so many processes; in the order of `parts`."""
    if folder is not None:
        Kept(folder)  # a folder of another build is told before anything runs
    for outcomes in spread(partial(run_part, folder=folder), parts, processes):
        yield from outcomes


def spread(work: Callable[[_P], _R], parts: Sequence[_P], processes: int) -> Iterator[_R]:
    """What comes of each part, on so many processes; in the order of `parts`."""
    from tqdm import tqdm

    bar = partial(tqdm, total=len(parts), desc="reliability", disable=None, leave=False)
    if processes <= 1 or len(parts) <= 1:
        yield from map(work, bar(parts))
        return
    with workers(processes) as pool:
        futures = [pool.submit(work, part) for part in parts]
        for _ in bar(as_completed(futures)):
            pass
    yield from (future.result() for future in futures)
