# SPDX-License-Identifier: Apache-2.0
"""The files that an analysis leaves in its directory, readable even if it is killed."""

import json
from collections.abc import Sequence
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np

from touchline import __version__
from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.logs import EstimateWriter, TableWriter
from touchline.logs.parquet import column_names
from touchline.model.robot import Robot
from touchline.observer.observer import Estimate
from touchline.pipeline.table import ContactTable, contact_schema
from touchline.report.postures import PostureWriter
from touchline.result.event import Event
from touchline.touch.spot import BEFORE, LIKELIER
from touchline.touch.touch import Touch

ESTIMATES, CONTACTS, POSTURES = "estimates.parquet", "contacts.parquet", "postures.parquet"
EVENTS, ANALYSIS, REPORT = "events.json", "analysis.json", "report.html"
TABLES = (ESTIMATES, CONTACTS, POSTURES)
NAMES = (*TABLES, EVENTS, ANALYSIS, REPORT)
LONGEST = 10.0  # s; the first seconds of a longer touch tell its widget no more
REST = 100.0  # times as long as `events.json` took to write, until it is written again
MOST = 500  # samples of a touch that are looked at
CONTACT_SCHEMA = {"time": "f8", "health": "u4"} | contact_schema()


def is_result_table(columns: Sequence[str]) -> bool:
    """Whether a table is of an analysis, by its columns: any file may have such a table's name.

    It holds what was felt beside `health`, or joint positions and nothing to feel by.
    """
    signals = {name for name in columns if name != "time"}
    positions = {name for name in signals if name.startswith("q.")}
    if positions:
        return positions == signals
    felt = signals.issuperset(CONTACT_SCHEMA.keys() - {"time"})
    felt |= any(name.startswith("tau_ext.") for name in signals)
    return felt and "health" in signals


def check_inputs(directory: Path, *inputs: Path) -> None:
    """Make sure that no result would replace what it is made from, nor a recording.

    Raises:
        InputError: it would.
    """
    targets = {(directory / name).resolve() for name in NAMES}
    tables = {path: column_names(path) for name in TABLES if (path := directory / name).is_file()}
    others = [path for path, columns in tables.items() if columns and not is_result_table(columns)]
    for path in (*inputs, *others):
        if path.resolve() in targets:
            raise InputError(f"{path}: would be replaced by the results; choose another --out")


def write_text(path: Path, text: str) -> None:
    """Write a file in one step: a reader finds the old one or the new one, never half of it."""
    draft = path.with_name(f".{path.name}.part")
    draft.write_text(text, encoding="utf-8")
    draft.replace(path)


def strict(value: Any) -> Any:
    """The value with null in place of what JSON cannot say (NaN, infinities); arrays as lists."""
    if isinstance(value, np.ndarray):
        value = value.tolist()
    if isinstance(value, dict):
        return {str(key): strict(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [strict(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(value) if np.isfinite(value) else None
    return value.item() if isinstance(value, np.generic) else value


class _Pressed:
    """Names the widgets that events are on.

    Where a place is told, by the place; a spot that was taught by joint torques, by their step.
    """

    def __init__(self, robot: Robot, skin: Skin | None) -> None:
        self._touch = Touch(robot, skin)
        self._recent: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []

    def samples(self, time: np.ndarray, q: np.ndarray, torque: np.ndarray) -> None:
        """Takes time (N,), joint positions and external torques (N, n)."""
        if self._touch.spots is None:
            return
        self._recent.append((time, q, torque))
        while len(self._recent) > 1 and self._recent[1][0][0] < time[-1] - LONGEST:
            self._recent.pop(0)

    def named(self, event: Event) -> Event:
        """The event with its widget, if it is on one."""
        name = self._touch.widget_at(event.link, event.position_link)
        if name is None and self._touch.spots is not None and self._recent:
            time, q, torque = (np.concatenate(part) for part in zip(*self._recent, strict=True))
            end = float(time[-1]) if event.cleared is None else event.cleared
            near = (time > event.detected - BEFORE[0]) & (time <= end)
            thin = slice(None, None, max(1, int(near.sum()) // MOST))
            rows = time[near][thin], q[near][thin], torque[near][thin]
            found, sure = self._touch.spots.read_event(*rows, event.detected, end)[0]
            name = found if sure >= LIKELIER else None
        return event.replace(widget=name)


def _write_lines(path: Path, lines: Sequence[str]) -> None:
    body = ",\n".join(lines)
    write_text(path, f"[\n{body}\n]\n" if lines else "[]\n")


def write_origin(path: Path, log: str, robot: Path | str, facts: dict[str, Any]) -> None:
    """Write `analysis.json`: what the results were made from, for whoever finds them later.

    Args:
        path: of the file.
        log: where the recording is.
        robot: as it was given, a file or the name of a robot that ships with Touchline.
        facts: what else there is to keep.
    """
    where = str(Path(robot).resolve()) if Path(robot).is_file() else str(robot)
    content = {"touchline": __version__, "log": log, "robot": where, **facts}
    write_text(path, json.dumps(strict(content), indent=1, allow_nan=False) + "\n")


class Outputs:
    """The tables of a running analysis and its list of events."""

    def __init__(self, directory: Path, robot: Robot, skin: Skin | None = None) -> None:
        self.directory = directory
        self._pressed = _Pressed(robot, skin) if robot.description.interface else None
        names = (robot.joint_names, robot.sensor_names, robot.segment_names)
        self._estimates = EstimateWriter(directory, *names)
        self._contacts = TableWriter(directory / CONTACTS, CONTACT_SCHEMA)
        self._postures = PostureWriter(directory / POSTURES, robot)
        self._written: list[Any] = []
        self._write_next = 0.0  # by the clock, at the earliest
        self._lines: dict[int, str] = {}  # of events that have ended, which change no more
        _write_lines(self.directory / EVENTS, [])

    def estimates(self, time: np.ndarray, estimate: Estimate) -> None:
        """Append the estimates of N samples."""
        self._estimates.write(
            time, estimate.health, estimate.tau_ext, estimate.sensor_wrench, estimate.segment_wrench
        )

    def pressed(self, time: np.ndarray, q: np.ndarray, estimate: Estimate) -> None:
        """Take what tells of widgets in N samples, before the events that end in them."""
        if self._pressed is not None:
            self._pressed.samples(time, q, np.asarray(estimate.tau_ext))

    def postures(self, time: np.ndarray, q: np.ndarray) -> None:
        """Append how the arm stood in N samples, thinned."""
        self._postures.add(time, q)

    def contacts(self, time: np.ndarray, estimate: Estimate, table: ContactTable) -> None:
        """Append the contacts of N samples."""
        rows = {"time": time[table.sample], "health": estimate.health[table.sample].astype("u4")}
        self._contacts.write(rows | table.columns())

    def events(self, events: Sequence[Event]) -> None:
        """Bring `events.json` up to date: an event is in it soon after it is known."""
        for event in events:
            if event.id not in self._lines:
                self._told(event)  # in time: what tells of widgets goes on
        began = monotonic()
        if began < self._write_next:
            return
        state = [(event.cleared, event.level) for event in events]
        if state != self._written:
            _write_lines(self.directory / EVENTS, [self._told(event) for event in events])
            ended = monotonic()
            self._written, self._write_next = state, ended + REST * (ended - began)

    def _told(self, event: Event) -> str:
        line = self._lines.get(event.id)
        if line is None:
            named = event if self._pressed is None else self._pressed.named(event)
            line = json.dumps(strict(named.as_json()), allow_nan=False)
            if event.cleared is not None:
                self._lines[event.id] = line
        return line

    def finish(self, events: Sequence[Event]) -> None:
        """Turn the parts into the tables, and write the events for good."""
        self._estimates.close()
        self._contacts.close()
        self._postures.close()
        _write_lines(self.directory / EVENTS, [self._told(event) for event in events])
