# SPDX-License-Identifier: Apache-2.0
"""One recording in a process of its own: whatever happens to it becomes a row."""

import os
import resource
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from touchline import __version__
from touchline.errors import InputError
from touchline.fleet.figures import FIGURES, make_figures
from touchline.fleet.manifest import Row, file_hash, stands
from touchline.fleet.own import why_none
from touchline.fleet.plan import Recording
from touchline.fleet.remote import fetched
from touchline.logs.bagfile import first_line
from touchline.memory import peak_megabytes
from touchline.workers import follow_parent


@dataclass(frozen=True)
class Job:
    """What a worker is asked for.

    Attributes:
        recording: to analyze.
        out: folder of all results.
        configuration: hash of robot and options.
        options: of `analyze`.
        known: the row of an earlier run.
    """

    recording: Recording
    out: Path
    configuration: str
    options: dict[str, Any]
    known: Row | None = None


def serve(pipe: Any, memory: int | None) -> None:
    """Take jobs from a pipe and answer with rows, until it is closed.

    Args:
        pipe: end of a `multiprocessing.Pipe`.
        memory: that the process may take [bytes].
    """
    follow_parent()
    os.environ["TQDM_DISABLE"] = "1"
    if memory is not None:
        resource.setrlimit(resource.RLIMIT_AS, (memory, memory))
    try:
        while (job := pipe.recv()) is not None:
            pipe.send(done(job))
    except (EOFError, OSError, KeyboardInterrupt):  # the one who asks is gone, or has enough
        return


def done(job: Job) -> Row:
    """Analyze a recording; its row. Nothing is raised but what ends the process."""
    began, cpu = time.monotonic(), time.process_time()
    row = blank(job, "failed", "")
    try:
        with _at_hand(job) as log:
            row["content"] = file_hash(log)
            known = job.known
            if known is not None and known.get("status") in ("ok", "partial"):
                keys = ("content", "configuration", "robot")
                same = all(known.get(key) == row[key] for key in keys)
                if same and stands(known, job.out):
                    return known | {"unchanged": True}
            row |= _analyzed(job, log)
    except InputError as error:
        row["reason"] = error.problems[0]
    except MemoryError:
        row["reason"] = "not enough memory"
    except OSError as error:
        row["reason"] = f"{error.filename or job.recording.source}: {error.strerror or error}"
    except Exception as error:  # a recording never stops the others
        row["reason"] = f"{type(error).__name__}: {first_line(error)}"
    row["seconds"] = round(time.monotonic() - began, 3)
    row["cpu_seconds"] = round(time.process_time() - cpu, 3)
    row["memory_mb"] = peak_megabytes()
    return row


def blank(job: Job, status: str, reason: str) -> Row:
    """The row of a recording that was not analyzed."""
    recording = job.recording
    return {
        "name": recording.name,
        "log": recording.source,
        "robot": recording.robot,
        "status": status,
        "reason": reason,
        "content": None,
        "configuration": job.configuration,
        "touchline": __version__,
        "bytes": recording.size,
        "samples": 0,
        "flagged": 0,
        "duration": 0.0,
        "events": 0,
        "collisions": 0,
        "faint": [],
        "outputs": {},
    }


@lru_cache(maxsize=4)
def _model(robot: str, configuration: str, friction: float | None, reach: float | None) -> Any:
    """A robot; `configuration` is the hash of all that it is described by."""
    from touchline.model.pushes import with_pushes
    from touchline.model.robot import load_robot

    return with_pushes(load_robot(robot), friction, reach)


def _at_hand(job: Job) -> AbstractContextManager[Path]:
    """The recording as a file of this machine."""
    if job.recording.url:
        return fetched(job.recording.url, job.out / job.recording.name)
    return nullcontext(job.recording.log)


def _analyzed(job: Job, log: Path) -> Row:
    if reason := why_none(log):  # of a URL only seen now
        return {"status": "skipped", "reason": reason}
    from touchline.report.analysis import analyze_as
    from touchline.report.outputs import NAMES

    out, robot = job.out / job.recording.name, job.recording.robot
    options = dict(job.options)
    pushes = options.pop("friction", None), options.pop("reach", None)
    model = _model(robot, job.configuration, *pushes)
    origin = job.recording.url or None
    analysis = analyze_as(model, robot, log, out, **options, origin=origin, threads=1)
    make_figures(out, analysis.robot.name)
    clock = analysis.statistics.clock
    files = [out / name for name in (*NAMES, FIGURES) if (out / name).is_file()]
    return {
        "status": "partial" if analysis.losses else "ok",
        "reason": analysis.losses[0] if analysis.losses else "",
        "samples": clock.rows,
        "flagged": clock.rows - analysis.statistics.healthy,
        "duration": round(clock.duration, 6),
        "events": len(analysis.events),
        "collisions": sum(event.level == "collision" for event in analysis.events),
        "faint": list(analysis.faint),
        "outputs": {file.name: file_hash(file) for file in files},
    }
