# SPDX-License-Identifier: Apache-2.0
"""A running robot from its first second to the end: checked, observed, recorded, told."""

import json
import time
from collections import deque
from collections.abc import Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path
from typing import TextIO

import numpy as np
from numpy.typing import ArrayLike

from touchline.errors import InputError
from touchline.identify.payload import weigh_load
from touchline.live.connection import Connection, Notice
from touchline.live.preflight import SECONDS, Reason, preflight
from touchline.live.recorder import Recorder, check_name, make_recorder
from touchline.live.sample import Sample
from touchline.live.source import NativeSource
from touchline.localizer.skin import Skin
from touchline.logs.period import typical_period
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline, Result
from touchline.result.event import Event
from touchline.touch.touch import Touch, TouchEvent

SILENT = 5.0  # s without a sample, after which `duration` is over on this machine's clock too
LONGEST_START = 3.0  # s in which the first second has to come
RECENT = 5.0  # s of samples that are kept to weigh a load in
MOST_RECENT = 40_000  # of them: 5 s at 8 kHz
KEPT_EVENTS = 1000  # that are over; `events` has all of them on disk


@dataclass
class EventNews:
    """What is new of the events: each is told once when it begins and once when it ends.

    Attributes:
        began: events that began.
        ended: events that ended, with the `widget` that they were on.
        touches: what people did with the arm's interface.
    """

    began: list[Event] = field(default_factory=list)
    ended: list[Event] = field(default_factory=list)
    touches: list[TouchEvent] = field(default_factory=list)


class Session:
    """Reads a robot, and makes contacts and events of it.

    Args:
        robot: that is observed.
        connection: to it, opened or not.
        record: where every sample is written, if anywhere: `.mcap` or `.parquet`.
        force: goes live whatever the first second looks like.
        events: where each event is written when it is over, as a line of JSON, if anywhere. In
            memory the latest 1000 are kept.

    Attributes:
        pipeline: that takes the samples; None before `start`.
        touch: that follows the robot's `interface`; None where it has none.
        reasons: that spoke against going live.
        samples: number of samples so far.
        result: of the last sample; None while there is no honest one, as when nothing arrives.
    """

    def __init__(
        self,
        robot: Robot,
        connection: Connection,
        record: Path | None = None,
        force: bool = False,
        events: Path | None = None,
    ) -> None:
        self.robot, self.connection = robot, connection
        self._record, self._force, self._events = record, force, events
        self._written: TextIO | None = None
        self._skin = Skin(robot)
        self.pipeline: Pipeline | None = None
        self.touch = Touch(robot, self._skin) if robot.description.interface else None
        self._widgets: dict[int, str] = {}  # that events which last are on
        self._attached: Pipeline | None = None  # the one that a native source feels with
        self._recorder: Recorder | None = None
        self._kept = ExitStack()
        self.reasons: list[Reason] = []
        self.samples = 0
        self.sample: Sample | None = None
        self.result: Result | None = None
        self._first: list[Sample] = []
        self._recent: deque[Sample] = deque(maxlen=MOST_RECENT)
        self._origin = 0.0
        self._fresh = EventNews()

    def start(self) -> list[Reason]:
        """Connects, looks at the first second and makes everything ready.

        Returns:
            What spoke against going live; something only with `force`.

        Raises:
            InputError: nothing can be read, or something speaks against going live.
        """
        if self._record is not None:
            check_name(self._record)
        if self._events is not None:
            self._written = self._kept.enter_context(_opened(self._events))
        try:
            self._kept.callback(self.connection.close)
            self.connection.open()
            self._first = self._first_second()
            self._origin = self._first[0].time if self._first else 0.0
            self.reasons = preflight(self.robot, self._first)
            if self.reasons and not self._force:
                name = self.connection.source.name
                lines = [f"{name}: not live: {reason}" for reason in self.reasons]
                raise InputError([*lines, f"{name}: --force goes live all the same"])
            period = self.connection.source.period
            period = period or typical_period(_times(self._first))
            self._period = period
            self.pipeline = self._made()
            if self._record is not None:
                recorder = make_recorder(
                    self._record, self.robot, period, self.connection.source.name
                )
                self._recorder = self._kept.enter_context(recorder)
        except BaseException:
            self.close()
            raise
        self.connection.notices.clear()  # of the start, which has gone well
        return self.reasons

    def _made(self) -> Pipeline:
        pipeline = Pipeline(self.robot, period=self._period, skin=self._skin)
        pipeline.keep_events(KEPT_EVENTS)
        return pipeline

    def reset(self) -> str:
        """Forgets the past: the estimate starts anew, events that last end; returns what was done.

        A recording goes on. What it is replayed to differs from here, as after the next two.
        """
        self._running().reset()
        self.result = None
        return "reset: the estimate starts anew"

    def tare(self) -> str:
        """Takes what is felt now for offsets, as `Pipeline.tare`; returns what was done.

        Raises:
            InputError: something touches the arm, or it was not at rest for half a second.
        """
        try:
            taken = self._running().tare()
        except ValueError as error:
            raise InputError(str(error)) from None
        self.result = None
        parts = []
        names = zip(self.robot.sensor_names, taken.wrench, strict=True)
        for name, wrench in names:
            force, moment = np.linalg.norm(wrench[:3]), np.linalg.norm(wrench[3:])
            parts.append(f"{force:.2f} N and {moment:.3f} Nm at {name}")
        torques = np.abs(taken.torque[np.isfinite(taken.torque)])
        if len(torques):
            parts.append(f"up to {torques.max():.2f} Nm at a joint")
        told = f"tare: took off {', '.join(parts) or 'nothing: no signal is measured'}"
        return f"{told}. {taken.doubt}" if taken.doubt else told

    def set_load(self, link: str, mass: float | None = None, com: ArrayLike = (0, 0, 0)) -> str:
        """Tells what a link carries from now on; returns what was done.

        Args:
            link: that carries it.
            mass: [kg]; 0 takes it off; None: weighed in the last seconds of free motion.
            com: (3,) its centre in the link's frame [m], if the mass is given.

        Raises:
            InputError: there is no such link, no arm carries such a body, or nothing could be
                weighed: no load shows, or what shows is no load alone.
        """
        pipeline, error = self._running(), ""
        if mass is None:
            found = weigh_load(pipeline.robot, [_samples(self._recent)], link)
            mass, com = found.mass, found.com
            error = f" +- {found.mass_error:.3f}"
            if found.doubt:
                raise InputError(
                    f"no load is set on {link}: {mass:.3f}{error} kg would fit best, but "
                    f"{found.doubt}"
                )
        try:
            doubt = pipeline.set_load(link, mass, com)
        except ValueError as problem:
            raise InputError(str(problem)) from None
        self.result = None
        doubt = f". But {doubt}" if doubt else ""
        if mass == 0.0:
            return f"set_load: {link} carries nothing more than described{doubt}"
        where = ", ".join(f"{x:+.3f}" for x in np.asarray(com, dtype=float))
        return f"set_load: {link} carries {mass:.3f}{error} kg at ({where}) m of its frame{doubt}"

    def _running(self) -> Pipeline:
        if self.pipeline is None:
            raise InputError(f"{self.connection.source.name}: not live yet")
        return self.pipeline

    @property
    def origin(self) -> float:
        """The first sample's time [s], from which times are told."""
        return self._origin

    def _first_second(self) -> list[Sample]:
        samples: list[Sample] = []
        end = time.monotonic() + LONGEST_START
        while time.monotonic() < end and not self.connection.ended:
            samples += self.connection.read()
            if samples and samples[-1].time - samples[0].time >= SECONDS:
                break
        return samples

    def run(self, duration: float | None = None) -> Iterator[EventNews]:
        """Takes samples as they come; yields after each read, with what is new.

        Args:
            duration: ends after so long by the sensors' clock [s]; default: when the source ends.
        """
        assert self.pipeline is not None, "start() makes it"
        waiting, self._first = self._first, []
        end = time.monotonic() + (duration or np.inf)
        while True:
            for sample in waiting:
                if duration is not None and sample.time - self._origin > duration:
                    return
                self._take(sample)
            if not self.connection.usable:
                self.result = None
                if (now := time.monotonic()) > end and self.connection.streams[0].age(now) > SILENT:
                    return  # the sensors' clock stands
            self._attach()
            yield self._news()
            if self.connection.ended:
                return
            waiting = self.connection.read()

    def _take(self, sample: Sample) -> None:
        assert self.pipeline is not None
        if self._recorder is not None:
            self._recorder.add(sample)
        result: Result = sample.result or self.pipeline.update(*sample)
        self.result, self.sample = result, sample
        self._recent.append(sample)
        while sample.time - self._recent[0].time > RECENT:
            self._recent.popleft()
        self.samples += 1
        if self.touch is not None:
            for event in self.touch.update(result):
                self._fresh.touches.append(event)
                if event.kind == "press" and event.contact is not None and event.widget:
                    self._widgets[event.contact] = event.widget
        for change in result.events:
            if change.happened == "began":
                self._fresh.began.append(change.event)
            elif change.happened == "ended":
                self._end(self._named(change.event))

    def _end(self, event: Event) -> None:
        self._fresh.ended.append(event)
        self._write(event)

    def _write(self, event: Event) -> None:
        if self._written is not None:
            self._written.write(f"{json.dumps(event.as_json())}\n")
            self._written.flush()

    def _named(self, event: Event) -> Event:
        """An event that has ended with the widget that it was on, if any."""
        if self.touch is None:
            return event
        pressed = self._widgets.pop(event.id, None)
        place = self.touch.widget_at(event.link, event.position_link)
        return event.replace(widget=place or pressed)

    def _attach(self) -> None:
        """Lets a source that can do so feel in native threads, after the samples of the start."""
        source = self.connection.source
        if self._attached is not self.pipeline and isinstance(source, NativeSource):
            assert self.pipeline is not None
            source.attach(self.pipeline)
            self._attached = self.pipeline

    def notices(self) -> Iterator[Notice]:
        """What happened to the link and was not told yet."""
        while self.connection.notices:
            yield self.connection.notices.popleft()

    def _news(self) -> EventNews:
        """Events that began or ended since the last call."""
        news, self._fresh = self._fresh, EventNews()
        return news

    def close(self) -> None:
        """Ends the recording and the connection."""
        if self._written is not None and self.pipeline is not None:
            for event in self.pipeline.events:
                if event.cleared is None:
                    self._write(self._named(event))
            self._written = None
        self._kept.close()

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _opened(path: Path) -> TextIO:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        return path.open("w")
    except OSError as error:
        raise InputError(f"--events {path}: cannot be written: {error.strerror}") from None


def _times(samples: list[Sample]) -> np.ndarray:
    return np.array([sample.time for sample in samples])


def _samples(samples: Iterable[Sample]) -> Samples:
    time, q, qd, tau, wrench = (
        np.array(column) for column in zip(*(tuple(sample) for sample in samples), strict=True)
    )
    return Samples(time=time, q=q, qd=qd, tau=tau, wrench=wrench)
