# SPDX-License-Identifier: Apache-2.0
"""A running robot from its first second to the end: checked, observed, recorded, told."""

import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from touchline.errors import InputError
from touchline.live.connection import Connection, Notice
from touchline.live.preflight import SECONDS, Reason, preflight
from touchline.live.recorder import Recorder, make_recorder
from touchline.live.sample import Sample
from touchline.live.source import NativeSource
from touchline.localizer.skin import Skin
from touchline.logs.period import typical_period
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline, Result
from touchline.result.event import Event

SILENT = 5.0  # s without a sample, after which `duration` is over on this machine's clock too
LONGEST_START = 3.0  # s in which the first second has to come


@dataclass
class EventNews:
    """What is new of the events: each is told once when it begins and once when it ends."""

    began: list[Event] = field(default_factory=list)
    ended: list[Event] = field(default_factory=list)


class Session:
    """Reads a robot, and makes contacts and events of it.

    Args:
        robot: that is observed.
        connection: to it, opened or not.
        record: where every sample is written, if anywhere: `.mcap` or `.parquet`.
        force: goes live whatever the first second looks like.

    Attributes:
        pipeline: that takes the samples; None before `start`.
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
    ) -> None:
        self.robot, self.connection = robot, connection
        self._record, self._force = record, force
        self._skin = Skin(robot)
        self.pipeline: Pipeline | None = None
        self._attached: Pipeline | None = None  # the one that a native source feels with
        self._recorder: Recorder | None = None
        self._kept = ExitStack()
        self.reasons: list[Reason] = []
        self.samples = 0
        self.sample: Sample | None = None
        self.result: Result | None = None
        self._first: list[Sample] = []
        self._origin = 0.0
        self._fresh = EventNews()

    def start(self) -> list[Reason]:
        """Connects, looks at the first second and makes everything ready.

        Returns:
            What spoke against going live; something only with `force`.

        Raises:
            InputError: nothing can be read, or something speaks against going live.
        """
        self.connection.open()
        self._kept.callback(self.connection.close)
        try:
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
        return Pipeline(self.robot, period=self._period, skin=self._skin)

    def reset(self) -> bool:
        """Forgets the past: the pipeline starts anew, and events begin at 0 again.

        A recording goes on; what it is replayed to differs from here.
        """
        if self.pipeline is None:
            return False
        self.pipeline = self._made()
        self.result = None
        return True

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
        self.samples += 1
        for change in result.events:
            if change.happened == "began":
                self._fresh.began.append(change.event)
            elif change.happened == "ended":
                self._fresh.ended.append(change.event)

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
        self._kept.close()

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _times(samples: list[Sample]) -> np.ndarray:
    return np.array([sample.time for sample in samples])
