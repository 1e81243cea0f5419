# SPDX-License-Identifier: Apache-2.0
"""A running robot as an iterator of samples that lives through faults of the link."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Self

import numpy as np

from touchline.errors import InputError
from touchline.live.sample import Sample
from touchline.live.source import EndOfSource, LinkLost, Source
from touchline.live.streams import Stream, StreamState
from touchline.native import core

WAIT = 0.004  # s that a read waits at most: faults are told within 20 ms
RETRY = 0.02  # s between two attempts to reach a peer that is gone
FIRST_SAMPLE = 5.0  # s until the first sample has come, or nobody sends
REFUSED, SET_BACK = 1, 2  # verdicts of the native `Admission`


@dataclass(frozen=True)
class Notice:
    """Something that happened to the link.

    Attributes:
        at: when, on this machine's monotonic clock [s].
        stream: that it is about.
        state: that it is in now.
        text: one line.
    """

    at: float
    stream: str
    state: StreamState
    text: str


class Connection:
    """Samples of a running robot, for as long as it runs.

    A context manager and an iterator; `for sample in connection: pipeline.update(*sample)`. It
    reads and never commands. Samples that come twice or after a later one are refused; a lost
    link is opened again as soon as the peer is back.

    Args:
        source: not opened yet.

    Attributes:
        source: that is read.
        notes: what the source said when it was opened, one line each.
        refused: number of samples that came twice or too late.
    """

    def __init__(self, source: Source) -> None:
        self.source = source
        self.notes: list[str] = []
        self.notices: deque[Notice] = deque(maxlen=1000)
        self.refused = 0
        self._open = self._ended = False
        self._tried = -np.inf
        self._admission = core.Admission()
        self._last = 0.0  # the newest sample's time [s]
        self._states = {stream.name: StreamState.NOT_RECEIVED for stream in source.streams}
        self._ready: deque[Sample] = deque()

    @property
    def streams(self) -> tuple[Stream, ...]:
        """What arrives; the first stream makes the samples."""
        return self.source.streams

    @property
    def ended(self) -> bool:
        """Whether the source has no more samples."""
        return self._ended

    @property
    def usable(self) -> bool:
        """Whether samples come: an estimate of a stale or invalid stream is none."""
        state = self._states[self.streams[0].name]
        return state in (StreamState.OK, StreamState.SLOW)

    def open(self) -> None:
        """Connects, and waits for the first sample.

        Raises:
            InputError: nobody answers there, or what answers is not what was expected.
        """
        try:
            self.notes = self.source.open()
            self._open = True
            self._wait_for_first()
        except LinkLost as error:
            self.close()
            raise InputError(f"{self.source.name}: {error}") from None
        except BaseException:
            self.close()
            raise

    def _wait_for_first(self) -> None:
        end = time.monotonic() + FIRST_SAMPLE
        while not self._ready and not self._ended:
            if time.monotonic() > end:
                silent = [s.name for s in self.streams if not s.received]
                raise InputError(
                    f"{self.source.name}: connected, but no sample came within {FIRST_SAMPLE:g} s"
                    f" (nothing from {', '.join(silent)})"
                )
            self._ready.extend(self.read())

    def read(self, timeout: float = WAIT) -> list[Sample]:
        """The samples that have come since; none where nothing came within `timeout` [s].

        Raises:
            InputError: the peer is back but cannot be read any more.
        """
        if self._ready:
            samples = list(self._ready)
            self._ready.clear()
            return samples
        if self._ended:
            return []
        samples: list[Sample] = []
        try:
            if self._open or self._reopen(timeout):
                samples = [s for s in self.source.read(timeout) if self._accept(s)]
        except LinkLost as error:
            self._lose(str(error))
        except EndOfSource:
            self._ended = True
            return []
        self._judge()
        return samples

    def _reopen(self, timeout: float) -> bool:
        now = time.monotonic()
        if now - self._tried < RETRY:
            time.sleep(min(timeout, RETRY - (now - self._tried)))
            return False
        self._tried = now
        self.source.open()
        for stream in self.streams:
            stream.restart()
        self._open = True
        return True

    def _lose(self, why: str) -> None:
        self.source.close()
        if self._open:
            first = self.streams[0].name
            self._tell(first, StreamState.STALE, f"{self.source.name}: {why}; trying again")
        self._open = False

    def _accept(self, sample: Sample) -> bool:
        """Whether a sample goes on; what comes twice or too late does not."""
        if sample.result is not None:  # it went the same way in native code
            set_back = sample.time <= self._last
        else:
            verdict = self._admission.take(sample.time)
            if verdict == REFUSED:
                return self._refuse()
            set_back = verdict == SET_BACK
        if set_back:
            self._tell(
                self.streams[0].name,
                StreamState.OK,
                f"{self.source.name}: the clock was set back by {self._last - sample.time:.3f} s; "
                "the observer starts anew",
            )
        self._last = sample.time
        return True

    def _refuse(self) -> bool:
        self.refused += 1
        self.streams[0].refused += 1
        return False

    def _judge(self) -> None:
        """Tells of streams whose state has changed."""
        now = time.monotonic()
        for stream in self.streams:
            state = stream.state(now)
            if state != self._states[stream.name]:
                self._tell(stream.name, state, stream.describe(now), now)

    def _tell(self, stream: str, state: StreamState, text: str, at: float | None = None) -> None:
        self._states[stream] = state
        self.notices.append(Notice(at or time.monotonic(), stream, state, text))

    def close(self) -> None:
        """Disconnects."""
        self.source.close()
        self._open, self._ended = False, True

    def __iter__(self) -> Iterator[Sample]:
        while not self._ended:
            yield from self.read()

    def __enter__(self) -> Self:
        if not self._open:
            self.open()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
