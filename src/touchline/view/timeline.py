# SPDX-License-Identifier: Apache-2.0
"""The time line of a replay: when which segment was touched, and where the replay is."""

import numpy as np
import viser
from viser import uplot

from touchline.arrays import Array
from touchline.result.event import Event
from touchline.view.replay import Replay
from touchline.view.signals import Box, now_series, with_now

CONTACT, COLLISION = "#e0a33a", "#d0503f"
THICK = 0.33  # half of a bar, of the distance between rows
ROW, ROOM = 18, 62  # pixels: of a segment, and of the axis below with the title above
LETTER, GAP = 7.5, 12.0  # pixels: width of a letter of a row's name, and beside the name


class Timeline:
    """A strip per segment with its events.

    Args:
        gui: of the page.
        replay: whose events it shows.
        origin: from where times count on the page [s].
    """

    def __init__(self, gui: viser.GuiApi, replay: Replay, origin: float) -> None:
        self._replay, self._origin = replay, origin
        rows = [s for s in replay.robot.segment_names if _of(replay.events, s)]
        self._rows = rows or list(replay.robot.segment_names[:1])
        end = max(replay.end, replay.start + 1e-3) - origin
        self._box = Box(replay.start - origin, end, -0.5, len(self._rows) - 0.5)
        bars = [
            (row, self._edges(segment, level))
            for row, segment in enumerate(self._rows)
            for level in ("contact", "collision")
        ]
        self._times, self._heights = areas(bars, (self._box.left, self._box.right))
        none = uplot.Series_Points(show=False)
        series = [uplot.Series(label="time [s]")]
        for i, (row, _) in enumerate(bars):
            colour = COLLISION if i % 2 else CONTACT
            area = uplot.Series(width=0, fill=colour, fillTo=row - THICK, points=none)
            series.append(area)
        self._plot = gui.add_uplot(
            self._data(replay.start),
            (*series, now_series()),
            title="events by segment, over time [s]",
            scales={
                "x": uplot.Scale(time=False, range=(self._box.left, self._box.right)),
                "y": uplot.Scale(range=(self._box.low, self._box.high)),
            },
            axes=(uplot.Axis(), _names(self._rows)),
            legend=uplot.Legend(show=False),
            height=ROOM + ROW * len(self._rows),
            padding=(0, 24, 0, 24),
        )

    def _edges(self, segment: str, level: str) -> list[tuple[float, float]]:
        """Begin and end of each event [s]."""
        least = (self._replay.end - self._replay.start) / 400  # seen, however short
        edges = []
        for event in _of(self._replay.events, segment):
            if event.level == level:
                end = self._replay.end if event.cleared is None else event.cleared
                begin = event.detected - self._origin
                edges.append((begin, max(end - self._origin, begin + least)))
        return edges

    def _data(self, now: float) -> tuple[Array, ...]:
        return with_now(self._times, self._heights, now - self._origin, self._box)

    def update(self, now: float) -> None:
        """Moves the line to a time [s]."""
        self._plot.data = self._data(now)


def areas(
    bars: list[tuple[int, list[tuple[float, float]]]], ends: tuple[float, float]
) -> tuple[Array, Array]:
    """Times (N,) that increase from one end to the other, and upper borders (R, N) of areas.

    Args:
        bars: of each area, its row and where its bars begin and end.
        ends: of the time line.
    """
    edges_of_all = {t for _, edges in bars for edge in edges for t in edge}
    times = np.array(sorted(edges_of_all | set(ends)), float)
    x = np.repeat(times, 2)  # before and after each edge
    heights = []
    for row, edges in bars:
        y = np.full(len(x), row - THICK)
        for begin, end in edges:
            first, last = np.searchsorted(times, [begin, end])
            y[2 * first + 1 : 2 * last + 1] = row + THICK
        heights.append(y)
    return x, np.array(heights).reshape(len(bars), len(x))


def _names(rows: list[str]) -> uplot.Axis:
    """The axis that names rows, from the lowest."""
    return uplot.Axis(
        splits=tuple(range(len(rows))),
        values=tuple(rows),
        size=GAP + LETTER * max(map(len, rows)),
        space=1.0,
        grid=uplot.Axis_Grid(show=False),
        ticks=uplot.Axis_Ticks(show=False),
    )


def _of(events: list[Event], segment: str) -> list[Event]:
    return [event for event in events if event.segment == segment]
