# SPDX-License-Identifier: Apache-2.0
"""Hands out samples that are at hand already as late as a robot would send them."""

import time
from collections import deque
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from touchline.live.sample import Sample
from touchline.live.source import EndOfSource
from touchline.live.streams import Stream

LARGEST_DEBT = 0.2  # s by which the samples may be late before their clock is slowed down


def take_due(pace: "Pace", stream: Stream, timeout: float) -> list[Sample]:
    """The samples that are due, with their arrival, which the stream notes."""
    slips, found = pace.slips, pace.due(timeout)
    if pace.slips != slips:
        stream.forget_lag()
    now = time.monotonic()
    for sample in found:
        stream.receive(sample.time, now, bool(np.isfinite(sample.q).all()))
    return [replace(sample, arrival=now) for sample in found]


class Pace:
    """Samples in the time of their own clock.

    Args:
        samples: in order; asked for one sample at a time, and not before it is nearly due.
        speed: of their clock; 0: as fast as they can be had.
    """

    def __init__(self, samples: Iterator[Sample], speed: float) -> None:
        self._samples, self._speed = samples, speed
        self._next: Sample | None = None
        self.slips = 0  # how often it has given up catching up
        self._origin: float | None = None  # this clock's time at which the samples' is 0

    def due(self, timeout: float, most: int = 64) -> list[Sample]:
        """What is due now, after waiting at most so long [s] for the first.

        Raises:
            EndOfSource: there is no more.
        """
        found: deque[Sample] = deque()
        end = time.monotonic() + timeout
        while len(found) < most:
            if self._next is None:
                self._next = next(self._samples, None)
            if self._next is None:
                if found:
                    break
                raise EndOfSource
            wait = self._wait(self._next.time)
            if wait > 0.0:
                left = end - time.monotonic()
                if found or left <= 0.0:
                    break
                time.sleep(min(wait, left))
                if wait > left:
                    break
            found.append(self._next)
            self._next = None
        return list(found)

    def _wait(self, due: float) -> float:
        """How long it is until a sample's time comes [s]."""
        if self._speed == 0.0 or due != due:
            return 0.0
        now = time.monotonic()
        if self._origin is None:
            self._origin = now - due / self._speed
        wait = self._origin + due / self._speed - now
        if wait < -LARGEST_DEBT or wait > 10.0:  # too slow, or the clock of the samples was set
            self._origin = now - due / self._speed
            self.slips += 1
            return 0.0
        return wait
