# SPDX-License-Identifier: Apache-2.0
"""The main job on a recording: log in, estimates, contacts, events and report out."""

import os
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Mask
from touchline.check.felt import felt
from touchline.check.recording import glance
from touchline.detector.detector import Detection
from touchline.errors import InputError
from touchline.folder import ResultsFolder
from touchline.logs import Log, open_log
from touchline.logs.period import sample_period
from touchline.model.pushes import with_pushes
from touchline.model.robot import Robot, load_robot
from touchline.observer.bandwidths import bandwidth_warnings, bandwidths
from touchline.observer.observer import METHODS, Estimate
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.pipeline.table import ContactTable
from touchline.report.beside import Beside
from touchline.report.comparison import compare_log
from touchline.report.curves import Curves
from touchline.report.event_pictures import EventPoses
from touchline.report.event_windows import EventWindows
from touchline.report.facts import watch_warnings
from touchline.report.faint import faint_lines
from touchline.report.faulty import FaultyChannels
from touchline.report.outcome import Analysis, Report
from touchline.report.outputs import (
    ANALYSIS,
    NAMES,
    REPORT,
    Outputs,
    check_inputs,
    write_origin,
    write_text,
)
from touchline.report.statistics import Statistics
from touchline.result.event import Event
from touchline.result.fault import FaultChange
from touchline.result.kinds import Watch
from touchline.result.standing import standing_lines, unlike_told

CHUNK = 1 << 13  # samples; bounds the memory, and stays in the cache
LOOKED_AT = 20_000  # samples that are checked for wrong units, signs and weights


def analyze(
    log: Path | str,
    robot: Robot | Path | str,
    out: Path | str,
    bandwidth: float | None = None,
    method: str = "segment",
    report: Report = "full",
    origin: str | None = None,
    friction: float | None = None,
    reach: float | None = None,
    beside: Path | str | None = None,
) -> Analysis:
    """Analyze a recording; writes estimates, contacts, events and the report into a directory.

    Args:
        log: the recording.
        robot: the robot, or what `load_robot` takes. A later `touchline view` of the results reads
            it again, a `Robot` by its name.
        out: directory for the results.
        bandwidth: K [rad/s] of all rows; default: the description's.
        method: of the observer, "segment" or "paper".
        report: "full"; "summary" without a figure for each event; or "none".
        origin: where the recording really is, if `log` is a copy for a while.
        friction: coefficient of friction of what touches; default: the description's `pushes`.
        reach: free space that a push needs [m]; default: the description's `pushes`.
        beside: results of another run or method, shown in the report on the same time line.

    Raises:
        InputError: an input cannot be used, or another process writes into the directory.
            Older results in it stay then, and what this run had written stays readable in the
            folder `touchline.unfinished`.
    """
    check_options(bandwidth, method, friction, reach)
    source = robot.name if isinstance(robot, Robot) else robot
    model = with_pushes(robot if isinstance(robot, Robot) else load_robot(robot), friction, reach)
    options: dict[str, Any] = {"bandwidth": bandwidth, "method": method, "report": report}
    return analyze_as(model, source, Path(log), Path(out), **options, origin=origin, beside=beside)


def analyze_as(
    model: Robot,
    source: Path | str,
    log: Path,
    out: Path,
    bandwidth: float | None = None,
    method: str = "segment",
    report: Report = "full",
    origin: str | None = None,
    beside: Path | str | None = None,
    threads: int | None = None,
) -> Analysis:
    """`analyze` with a robot at hand, and `source`, where a later reader of the results finds it.

    Many recordings of one robot need not find out anew what only depends on the robot. `threads`
    is how many may work at a time; default: as many as there are cores.
    """
    threads = threads or os.cpu_count() or 1
    import pyarrow.parquet  # noqa: F401  the results need it: told before the work begins

    check_inputs(out, log, Path(source))
    other = None if beside is None else Beside(Path(beside))
    with open_log(log, model.description) as recording:
        parts = recording.chunks(CHUNK)
        first = next(parts, None)
        if first is None or not len(first):
            raise InputError(f"{log}: holds no samples")
        with ResultsFolder(out, NAMES) as folder:
            period = sample_period(recording, first.time)
            pipeline = _pipeline(model, bandwidth, method, period).afresh()
            run = _Run(pipeline, folder.draft, period, other, report)
            glanced = Glance()
            read = _with_progress(recording, chain([first], parts))
            for part in _ahead(map(run.follow, read), threads):
                glanced.add(part.samples, run.add(part))
            off = any(s.start for s in run.pipeline.standing)
            found = glance(model, glanced.parts, glanced.felt, off)
            warnings = bandwidth_warnings(bandwidths(model, bandwidth), run.period)
            warnings += [*recording.warnings, *model.warnings, *run.pipeline.skin.lost]
            warnings += watch_warnings(model, run.statistics)
            warnings += run.faulty.lines()
            warnings += standing_lines(run.pipeline.standing)
            warnings += [f"check: {line}" for line in found]
            analysis = run.finish(log, out, method, bandwidth, warnings, recording.losses)
            where = origin or str(log.resolve())
            facts = _origin(analysis) | {"findings": found}
            facts |= {"standing": [s.to_dict() for s in unlike_told(analysis.standing)]}
            facts |= {"tuning": dict(pipeline.tuning)}
            write_origin(folder.draft / ANALYSIS, where, source, facts)
            if report != "none":
                from touchline.report.page import page_text

                write_text(folder.draft / REPORT, page_text(analysis, report == "full", threads))
            folder.commit()
    return analysis


@lru_cache(maxsize=4)
def _pipeline(model: Robot, bandwidth: float | None, method: str, period: float) -> Pipeline:
    """A pipeline that stays as it begins."""
    return Pipeline(model, bandwidth, method, period)


class Glance:
    """Keeps the first samples of a recording, for a check of what they are.

    Attributes:
        parts: of the recording.
        felt: of each part, (N,): did the detector feel something then?
    """

    def __init__(self) -> None:
        self.parts: list[Samples] = []
        self.felt: list[Mask] = []
        self._kept = 0

    def add(self, part: Samples, felt: Mask) -> None:
        """Take the next samples, as long as there is room."""
        if self._kept < LOOKED_AT:
            keep = np.arange(len(part)) < LOOKED_AT - self._kept
            self.parts.append(part.where(keep))
            self.felt.append(felt[keep])
            self._kept += len(part)


def _origin(analysis: Analysis) -> dict[str, Any]:
    clock = analysis.statistics.clock
    pushes = analysis.robot.description.pushes
    facts = {"method": analysis.method, "bandwidth": analysis.bandwidth, "period": analysis.period}
    facts |= {"friction": pushes.friction, "reach": pushes.reach}
    names = analysis.robot.segment_names
    watch = {
        name: dict(zip(map(str, Watch), counts.tolist(), strict=True))
        for name, counts in zip(names, analysis.statistics.watch, strict=True)
    }
    clocked = {"start": clock.first, "end": clock.last, "samples": clock.rows}
    return facts | clocked | {"watch": watch}


def check_options(
    bandwidth: float | None,
    method: str,
    friction: float | None = None,
    reach: float | None = None,
) -> None:
    """Make sure that options of an analysis make sense.

    Raises:
        InputError: they do not.
    """
    given = {"bandwidth": (bandwidth, " [rad/s]"), "friction": (friction, "")}
    for name, (value, unit) in (given | {"reach": (reach, " [m]")}).items():
        if value is not None and not (np.isfinite(value) and value > 0):
            raise InputError(f"--{name} {value}: must be a positive number{unit}")
    if method not in METHODS:
        raise InputError(f"--method {method}: unknown; allowed: {', '.join(METHODS)}")


@dataclass(frozen=True)
class _Part:
    """Consecutive samples, and what the pipeline made of them; `watch` (N, m), `Watch` numbers."""

    samples: Samples
    estimate: Estimate
    detection: Detection
    watch: NDArray[np.int8]
    contacts: ContactTable
    events: list[Event]
    faults: tuple[FaultChange, ...]


def _ahead(parts: Iterator[_Part], threads: int) -> Iterator[_Part]:
    """The parts; while one is used, a thread of its own makes the next, if there may be one."""
    if threads == 1:
        yield from parts
        return
    with ThreadPoolExecutor(1) as pool:
        coming = pool.submit(next, parts, None)
        while (part := coming.result()) is not None:
            coming = pool.submit(next, parts, None)
            yield part


class _Run:
    """One recording on its way through the pipeline, a part at a time."""

    def __init__(
        self,
        pipeline: Pipeline,
        draft: Path,
        period: float,
        beside: Beside | None,
        report: Report,
    ) -> None:
        self.pipeline, self.period = pipeline, period
        self._report: Report = report
        robot = pipeline.robot
        self._outputs = Outputs(draft, robot, pipeline.skin)
        self.statistics = Statistics.of(len(robot.joint_names), len(robot.segment_names))
        self.faulty = FaultyChannels()
        self._curves = Curves(pipeline, self.period, beside)
        self._poses = EventPoses()
        columns = {
            name: [c.column for p in self._curves.event_panels(name) for c in p.curves]
            for name in robot.segment_names
        }
        self._windows = EventWindows(columns, self.period)

    def follow(self, samples: Samples) -> _Part:
        """Lead the next samples through the pipeline."""
        pipeline, signals = self.pipeline, (samples.q, samples.qd, samples.tau, samples.wrench)
        found = pipeline.run(samples.time, *signals)
        told = pipeline.watch, pipeline.contacts, pipeline.events, pipeline.faults
        return _Part(samples, *found, *told)

    def add(self, part: _Part) -> Mask:
        """Keep what there is to tell of a part; returns (N,) whether something was felt at each."""
        samples, events, time = part.samples, part.events, part.samples.time
        estimate, detection = part.estimate, part.detection
        self.statistics.add(time, estimate, detection, part.watch)
        self.faulty.add(time, part.faults)
        if self._report != "none":
            values = self._curves.values(samples, estimate, detection)
            self._curves.traces.add(time, values)
            self._windows.add(time, values, events)
            self._poses.add(time, samples.q, events)
        self._outputs.estimates(time, estimate)
        self._outputs.contacts(time, estimate, part.contacts)
        self._outputs.pressed(time, samples.q, estimate)
        self._outputs.events(events)
        self._outputs.postures(time, samples.q)
        return detection.touched

    def finish(
        self,
        log: Path,
        out: Path,
        method: str,
        bandwidth: float | None,
        warnings: list[str],
        losses: list[str],
    ) -> Analysis:
        """Close the files; returns what there is to tell."""
        events = self.pipeline.events
        self._outputs.finish(events)
        self._curves.add_beside(self.statistics.clock.last)
        comparisons, robot = compare_log(events, log), self.pipeline.robot
        touched = bool(events or comparisons)
        able = {one.link: one for one in felt(robot, self.period)} if touched else {}
        return Analysis(
            robot=robot,
            log=log,
            out=out,
            method=method,
            bandwidth=bandwidth,
            period=self.period,
            thresholds=self.pipeline.thresholds,
            statistics=self.statistics,
            curves=self._curves,
            events=events,
            poses=self._poses,
            windows=self._windows,
            comparisons=comparisons,
            standing=self.pipeline.standing,
            faint=faint_lines(events, comparisons, able),
            report=self._report,
            warnings=warnings,
            losses=losses,
        )


def _with_progress(log: Log, parts: Iterator[Samples]) -> Iterator[Samples]:
    from tqdm import tqdm

    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed} (about {remaining} left)"
    with tqdm(total=1.0, desc=log.path.name, bar_format=form, disable=None, leave=False) as bar:
        for part in parts:
            yield part
            bar.update(log.progress - bar.n)
