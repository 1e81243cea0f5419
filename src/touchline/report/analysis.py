# SPDX-License-Identifier: Apache-2.0
"""The main job on a recording: log in, estimates, contacts and events out."""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.contact.event import Event
from touchline.contact.pipeline import Pipeline
from touchline.errors import InputError
from touchline.estimation.observer import METHODS
from touchline.estimation.samples import Samples
from touchline.logs import Log, open_log
from touchline.model.robot import Robot, load_robot
from touchline.report.contact_rows import ContactRows
from touchline.report.outputs import Outputs, prepare_directory
from touchline.report.statistics import Statistics

CHUNK = 1 << 15  # samples; bounds the memory


@dataclass(frozen=True)
class Analysis:
    """What came out of a recording.

    Attributes:
        robot: the robot.
        log: path of the recording.
        out: directory with the results.
        method: of the observer.
        bandwidth: that overrides the description's [rad/s], or None.
        period: median time between the first samples [s].
        statistics: of all samples.
        events: all events.
        warnings: what the user should know.
    """

    robot: Robot
    log: Path
    out: Path
    method: str
    bandwidth: float | None
    period: float
    statistics: Statistics
    events: list[Event]
    warnings: list[str]


def analyze(
    log: Path | str,
    robot: Path | str,
    out: Path | str,
    bandwidth: float | None = None,
    method: str = "segment",
) -> Analysis:
    """Analyze a recording and write `estimates.parquet`, `contacts.parquet`, `events.json`.

    Args:
        log: the recording.
        robot: path of its `robot.yaml`, or the name of a robot that ships with Touchline.
        out: directory for the results.
        bandwidth: K [rad/s] of all rows; default: the description's.
        method: of the observer, "segment" or "paper".

    Raises:
        InputError: an input cannot be used; what had been written before stays readable.
    """
    _check_options(bandwidth, method)
    log, out, model = Path(log), Path(out), load_robot(robot)
    with open_log(log, model.description) as recording:
        parts = recording.chunks(CHUNK)
        first = next(parts, None)
        if first is None or not len(first):
            raise InputError(f"{log}: holds no samples")
        prepare_directory(out, log, Path(robot))
        period = typical_period(first.time)
        pipeline = Pipeline(model, bandwidth, method, period)
        statistics = _stream(recording, _chain(first, parts), pipeline, Outputs(out, model))
        warnings = [*recording.warnings, *model.warnings]
    return Analysis(
        model, log, out, method, bandwidth, period, statistics, pipeline.events, warnings
    )


def typical_period(time: np.ndarray) -> float:
    """Median step of time stamps [s] that go forward; 1 ms where there is none."""
    steps = np.diff(time[np.isfinite(time)])
    steps = steps[steps > 0]
    return float(np.median(steps)) if len(steps) else 1e-3


def _check_options(bandwidth: float | None, method: str) -> None:
    if bandwidth is not None and not (np.isfinite(bandwidth) and bandwidth > 0):
        raise InputError(f"--bandwidth {bandwidth}: must be a positive number [rad/s]")
    if method not in METHODS:
        raise InputError(f"--method {method}: unknown; allowed: {', '.join(METHODS)}")


def _chain(first: Samples, rest: Iterator[Samples]) -> Iterator[Samples]:
    yield first
    yield from rest


def _stream(
    log: Log, parts: Iterator[Samples], pipeline: Pipeline, outputs: Outputs
) -> Statistics:
    robot = pipeline.robot
    statistics = Statistics.of(len(robot.joint_names), len(robot.segment_names))
    contact_rows = ContactRows(robot)
    for part in _with_progress(log, parts):
        estimate, detection = pipeline.run(part.time, part.q, part.qd, part.tau, part.wrench)
        statistics.add(part.time, estimate, detection)
        outputs.estimates(part.time, estimate)
        outputs.contacts(contact_rows.rows(part.time, estimate, detection, pipeline.events))
        outputs.events(pipeline.events)
    outputs.finish(pipeline.events)
    return statistics


def _with_progress(log: Log, parts: Iterator[Samples]) -> Iterator[Samples]:
    from tqdm import tqdm

    form = "{desc} {percentage:3.0f} %|{bar}| {elapsed} (about {remaining} left)"
    with tqdm(total=1.0, desc=log.path.name, bar_format=form, disable=None, leave=False) as bar:
        for part in parts:
            yield part
            bar.update(log.progress - bar.n)
