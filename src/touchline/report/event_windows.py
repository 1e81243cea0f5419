# SPDX-License-Identifier: Apache-2.0
"""The curves around each event, finer than those of the whole recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array
from touchline.report.traces import Traces
from touchline.result.event import Event

Array32 = NDArray[np.float32]

PIECES = 512
BEFORE, AFTER, LONGEST = 0.4, 0.6, 20.0  # s; of an event, at most so much after it began
MOST_WINDOWS = 800  # events; each takes some 60 kB of memory


@dataclass(frozen=True)
class Window:
    """Least and largest values around an event.

    Attributes:
        start: time at which the first piece begins [s].
        width: of a piece [s].
        columns: numbers (c,) of the columns, as of `Curves`.
        low: (P, c) smallest values; NaN where a piece holds no sample.
        high: (P, c) largest values.
    """

    start: float
    width: float
    columns: tuple[int, ...]
    low: Array32
    high: Array32

    def coarser(self, most: int) -> "Window":
        """The same with at most so many pieces, each of several."""
        pieces = len(self.low)
        step = -(-pieces // most)
        starts = np.arange(0, pieces, step)
        low = np.fmin.reduceat(self.low, starts, axis=0)
        high = np.fmax.reduceat(self.high, starts, axis=0)
        return Window(self.start, self.width * step, self.columns, low, high)

    def of(self, column: int) -> tuple[Array32, Array32]:
        """Smallest and largest values (P,) of one column."""
        i = self.columns.index(column)
        return self.low[:, i], self.high[:, i]


class EventWindows:
    """Gathers the windows while a recording streams by.

    Args:
        columns: of the curves that belong to events of a segment, by its name.
        period: time between samples [s].
    """

    def __init__(self, columns: Mapping[str, Sequence[int]], period: float) -> None:
        self._columns = {name: tuple(numbers) for name, numbers in columns.items()}
        self._period = period
        self._growing: dict[int, tuple[Event, Traces]] = {}
        self._done: dict[int, Window] = {}
        self._begun = 0  # events that have been met
        self._time: Array = np.zeros(0)  # of what came last, for what lies before an event
        self._values: Array = np.zeros((0, 0))

    def add(self, time: Array, values: Array, events: Sequence[Event]) -> None:
        """Take N samples: `time` (N,) [s], all columns (N, c), and the events found so far."""
        if not len(time):
            return
        for number in list(self._growing):
            event, traces = self._growing[number]
            self._take(event, traces, time, values)
        new, recent = events[self._begun :], round(BEFORE / self._period) + 1
        whole_time, whole = time, values
        if len(self._time) and (new or len(time) < recent):
            whole_time = np.concatenate([self._time, time])
            whole = np.vstack([self._values, values])
        for event in new:
            if len(self._done) + len(self._growing) >= MOST_WINDOWS:
                break
            traces = Traces(len(self._columns[event.segment]), PIECES, self._period)
            self._growing[event.id] = (event, traces)
            self._take(event, traces, whole_time, whole)
        self._begun = len(events)
        finite = time[np.isfinite(time)]
        if len(finite):
            self._finish(float(finite[0]))
        self._time, self._values = whole_time[-recent:].copy(), whole[-recent:].copy(order="A")

    def _take(self, event: Event, traces: Traces, time: Array, values: Array) -> None:
        rows = (time >= event.detected - BEFORE) & (time <= _end(event))
        if rows.any():
            traces.add(time[rows], values[rows][:, list(self._columns[event.segment])])

    def _finish(self, now: float) -> None:
        for number, (event, traces) in list(self._growing.items()):
            if now > _end(event):
                self._done[number] = self._window(event, traces)
                del self._growing[number]

    def _window(self, event: Event, traces: Traces) -> Window:
        used = traces.used
        low, high = (a[:used].astype(np.float32) for a in (traces.low, traces.high))
        return Window(traces.start, traces.width, self._columns[event.segment], low, high)

    def get(self, event: Event) -> Window | None:
        """The window of an event; None where there is none."""
        if event.id in self._growing:
            window = self._window(*self._growing[event.id])
        else:
            window = self._done.get(event.id)
        return window if window is not None and len(window.low) else None


def _end(event: Event) -> float:
    latest = event.detected + LONGEST
    return latest if event.cleared is None else min(event.cleared + AFTER, latest)
