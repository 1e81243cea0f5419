# SPDX-License-Identifier: Apache-2.0
"""An analyzed recording, asked for how things stood at a time; the rest of it is not read."""

import json
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.folder import is_unfinished, settle
from touchline.logs.truth import TrueContact, read_truth
from touchline.model.description import AXES
from touchline.model.robot import load_robot
from touchline.result.contact import Candidate, Contact
from touchline.result.event import Event
from touchline.view.tables import TimedTable

NEEDED = ("estimates.parquet", "contacts.parquet", "postures.parquet", "events.json")
ORIGIN = "analysis.json"
STANDS = 0.1  # s; between postures farther apart the arm is drawn as it stood last
FRESH = 3.0  # periods; a contact's answer that is older is not shown
UPPER = ("pxx", "pxy", "pxz", "pyy", "pyz", "pzz")


@dataclass(frozen=True)
class Origin:
    """What results were made from, as `analysis.json` tells.

    Attributes:
        log: path of the recording.
        robot: path of the robot's description, or the name of one that ships with Touchline.
        period: between samples [s].
        start: first time stamp [s], and `end` the last.
    """

    log: Path
    robot: str
    period: float
    start: float
    end: float


def is_results(path: Path) -> bool:
    """Whether a path is a directory with the results of an analysis, whole or not."""
    if not path.is_dir():
        return False
    with suppress(OSError):  # a folder that only its owner may write
        settle(path)
    return is_unfinished(path) or any((path / name).exists() for name in (*NEEDED, ORIGIN))


def read_origin(directory: Path) -> Origin:
    """What the results in a directory were made from.

    Raises:
        InputError: the results are not complete, or `analysis.json` cannot be understood.
    """
    missing = [name for name in (*NEEDED, ORIGIN) if not (directory / name).is_file()]
    if missing and is_unfinished(directory):
        raise InputError(f"{directory}: the analysis did not finish; analyze the recording again")
    if missing:
        raise InputError(
            f"{directory}: {', '.join(missing)} missing: not the whole result of `touchline "
            "analyze`; analyze the recording (again)"
        )
    path = directory / ORIGIN
    try:
        found = json.loads(path.read_text(encoding="utf-8"))
        times = [float(found[key]) for key in ("period", "start", "end")]
        return Origin(Path(found["log"]), str(found["robot"]), *times)
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise InputError(f"{path}: cannot be understood ({error}); analyze again") from error


class Replay:
    """The results of an analysis.

    Args:
        directory: where `analyze` wrote them.
        robot: name or path of the robot, in place of the one they were made with.

    Attributes:
        robot: the robot.
        origin: what the results were made from.
        events: all events, in the order of their detection.

    Raises:
        InputError: the results or the robot cannot be used, or do not belong together.
    """

    def __init__(self, directory: Path, robot: str | None = None) -> None:
        self.origin = read_origin(directory)
        self.robot = load_robot(robot or self.origin.robot)
        self.events = _read_events(directory / "events.json")
        self._postures = TimedTable(directory / "postures.parquet")
        self._contacts = TimedTable(directory / "contacts.parquet")
        self.estimates = TimedTable(directory / "estimates.parquet")
        names = [f"q.{name}" for name in self.robot.joint_names]
        if self._postures.columns[1:] != tuple(names):
            raise InputError(
                f"{directory}: holds joints {', '.join(self._postures.columns[1:])}, but robot "
                f"'{self.robot.name}' has {', '.join(names)}; give the robot of the recording"
            )
        self._names = names

    @property
    def start(self) -> float:
        """The first time stamp [s]."""
        return self.origin.start

    @property
    def end(self) -> float:
        """The last time stamp [s]."""
        return self.origin.end

    @cached_property
    def truth(self) -> list[TrueContact]:
        """What really touched, if the log is a simulated one and still there."""
        try:
            return read_truth(self.origin.log)
        except (OSError, ValueError, KeyError):  # moved, or no such log any more
            return []

    def true_contacts(self, time: float) -> list[tuple[Array, Array]]:
        """Points (3,) [m] and forces (3,) [N] of the truth at a time [s], in world."""
        lasting = [contact for contact in self.truth if contact.lasts_at(time)]
        return [(contact.point_at(time), contact.force_at(time)) for contact in lasting]

    @cached_property
    def _stood(self) -> tuple[Array, Array]:
        """Times (N,) [s] that increase, and joint positions (N, n)."""
        table = self._postures
        time = np.concatenate([table.values("time", g) for g in range(table.groups)] or [[]])
        q = [
            np.concatenate([table.values(name, g) for g in range(table.groups)] or [[]])
            for name in self._names
        ]
        order = np.argsort(time, kind="stable")
        return time[order], np.column_stack(q)[order]

    @property
    def times(self) -> Array:
        """Times (N,) [s] at which the posture is known; they do not decrease."""
        return self._stood[0]

    def posture(self, time: float) -> Array:
        """Joint positions (n,) [rad or m] at a time [s], straight between those that are known.

        Before the first and after the last it is that one; 0 where none was measured.
        """
        stamps, q = self._stood
        if not len(stamps):
            return np.zeros(len(self.robot.joint_names))
        after = int(np.searchsorted(stamps, time, side="right"))
        if after == 0 or after == len(stamps):
            return q[min(after, len(stamps) - 1)]
        step = stamps[after] - stamps[after - 1]
        if not 0.0 < step <= STANDS:
            return q[after - 1]
        part = (time - stamps[after - 1]) / step
        return (1 - part) * q[after - 1] + part * q[after]

    def events_at(self, time: float) -> list[Event]:
        """Events that last at a time [s]."""
        return [
            event
            for event in self.events
            if event.detected <= time and (event.cleared is None or time < event.cleared)
        ]

    def contacts(self, time: float) -> list[Contact]:
        """The contacts at a time [s]: of each event that lasts, what was said of it last."""
        found = []
        for event in self.events_at(time):
            contact = self._contact(event, time)
            if contact is not None:
                found.append(contact)
        return found

    def _contact(self, event: Event, time: float) -> Contact | None:
        oldest = time - max(FRESH * self.origin.period, 0.02)
        for group in reversed(self._contacts.groups_between(oldest, time)):
            stamps = self._contacts.values("time", group)
            own = self._contacts.values("event", group) == event.id
            rows = np.flatnonzero(own & (stamps <= time) & (stamps >= oldest))
            if len(rows):
                return self._contact_of(event, group, int(rows[stamps[rows].argmax()]), time)
        return None

    def _contact_of(self, event: Event, group: int, row: int, time: float) -> Contact:
        def value(name: str) -> Any:
            return self._contacts.values(name, group)[row]

        def vector(names: tuple[str, ...]) -> Array | None:
            values = np.array([value(name) for name in names], float)
            return values if np.isfinite(values).all() else None

        probability = float(value("body_probability"))
        status, placed = str(value("status")), value("x") == value("x")
        return Contact(
            segment=event.segment,
            event=event.id,
            level=event.level,
            status=status,
            wrench=None if placed else vector(AXES),  # of the segment, where no point is known
            link=value("link"),
            body=value("body"),
            body_probability=probability if np.isfinite(probability) else None,
            position=vector(("x", "y", "z")),
            force=vector(("fx", "fy", "fz")),
            covariance=_symmetric(vector(UPPER)),
            candidates=() if status == "located" else self._candidates(event, time),
        )

    def _candidates(self, event: Event, time: float) -> tuple[Candidate, ...]:
        """Those of the event, carried along by their links since the time they were found at."""
        if event.time_of_position is None or not event.candidates:
            return ()
        then = self.robot.T_world_links(self.posture(event.time_of_position))
        now = self.robot.T_world_links(self.posture(time))
        moved = []
        for candidate in event.candidates:
            if candidate.link not in now:
                continue
            T_now_then = now[candidate.link] @ np.linalg.inv(then[candidate.link])
            place = T_now_then[:3, :3] @ candidate.position + T_now_then[:3, 3]
            one = Candidate(candidate.link, candidate.body, candidate.probability, place)
            moved.append(one)
        return tuple(moved)

    @cached_property
    def signals(self) -> tuple[str, ...]:
        """Names of all curves there are, as of the columns of `estimates.parquet`."""
        return tuple(n for n in self.estimates.columns if n not in ("time", "health"))

    @lru_cache(maxsize=256)  # noqa: B019  (a replay lives as long as the program)
    def curve(self, signal: str, begin: float, end: float, pieces: int) -> tuple[Array, Array]:
        """A curve with at most two points per piece of time, the least and the largest value.

        Args:
            signal: one of `signals`.
            begin: of the time shown [s].
            end: of the time shown [s].
            pieces: into which it is divided.

        Returns:
            Times (2 P,) [s] that increase, and values (2 P,), NaN where there are none.
        """
        table = self.estimates
        low, high = np.full(pieces, np.inf), np.full(pieces, -np.inf)
        width = (end - begin) / pieces
        for group in table.groups_between(begin, end):
            time, values = table.values("time", group), table.values(signal, group)
            used = (time >= begin) & (time < end) & np.isfinite(values)
            index = np.minimum(((time[used] - begin) / width).astype(int), pieces - 1)
            values = values[used]
            if not len(index):
                continue
            order = np.argsort(index, kind="stable") if (np.diff(index) < 0).any() else slice(None)
            index, values = index[order], values[order]
            begins = np.flatnonzero(np.diff(index, prepend=-1))
            where = index[begins]
            low[where] = np.minimum(low[where], np.minimum.reduceat(values, begins))
            high[where] = np.maximum(high[where], np.maximum.reduceat(values, begins))
        known = low <= high
        ends = np.where(known[:, None], np.column_stack([low, high]), np.nan)
        ends[1::2] = ends[1::2, ::-1]  # up and down by turns: shorter strokes
        times = begin + (np.arange(2 * pieces) + 0.5) * width / 2
        return times, ends.ravel()


def _symmetric(upper: Array | None) -> Array | None:
    if upper is None:
        return None
    xx, xy, xz, yy, yz, zz = upper
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _read_events(path: Path) -> list[Event]:
    try:
        return [_event(found) for found in json.loads(path.read_text(encoding="utf-8"))]
    except (ValueError, KeyError, TypeError, OSError) as error:
        raise InputError(f"{path}: cannot be understood ({error}); analyze again") from error


def _event(found: dict[str, Any]) -> Event:
    """An event as `Event.as_json` told it."""
    values = dict(found)
    for name in ("force", "position", "position_link"):
        if values[name] is not None:
            values[name] = np.array(values[name], float)
    values["candidates"] = tuple(
        Candidate(**c | {"position": np.array(c["position"], float)}) for c in values["candidates"]
    )
    return Event(**values)
