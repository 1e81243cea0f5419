# SPDX-License-Identifier: Apache-2.0
"""The time line of a replay: when which segment was touched, and where the replay is."""

import numpy as np
import viser
from numpy.typing import NDArray

from touchline.contact.event import Event
from touchline.view.replay import Replay

Array = NDArray[np.float64]

CONTACT, COLLISION, NOW = "#e0a33a", "#d0503f", "#22262b"
ROW, ROOM = 16, 62  # pixels: of a segment, and of the axis below with the names above


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
        self._bars = [
            self._edges(row, segment, level)
            for row, segment in enumerate(self._rows)
            for level in ("contact", "collision")
        ]
        span = (replay.start - origin, max(replay.end, replay.start + 1e-3) - origin)
        series = [viser.uplot.Series(label="s")]
        for i in range(len(self._bars)):
            colour = COLLISION if i % 2 else CONTACT
            series.append(viser.uplot.Series(stroke=colour, width=9, spanGaps=False))
        series.append(viser.uplot.Series(stroke=NOW, width=1.5))
        top = len(self._rows) - 0.5
        self._plot = gui.add_uplot(
            self._data(replay.start),
            tuple(series),
            title=" / ".join(reversed(self._rows)) + " (from below)" if rows[1:] else "events",
            scales={
                "x": viser.uplot.Scale(time=False, auto=False, min=span[0], max=span[1]),
                "y": viser.uplot.Scale(auto=False, min=-0.5, max=top),
            },
            axes=(viser.uplot.Axis(), viser.uplot.Axis(show=False)),
            legend=viser.uplot.Legend(show=False),
            height=ROOM + ROW * len(self._rows),
        )

    def _edges(self, row: int, segment: str, level: str) -> list[tuple[float, float, float]]:
        """Begin and end of each event [s] and the height of its bar."""
        least = (self._replay.end - self._replay.start) / 400  # seen, however short
        bars = []
        for event in _of(self._replay.events, segment):
            if event.level == level:
                end = self._replay.end if event.cleared is None else event.cleared
                begin = event.detected - self._origin
                bars.append((begin, max(end - self._origin, begin + least), float(row)))
        return bars

    def _data(self, now: float) -> tuple[Array, ...]:
        """Times that increase, a row per bar that is NaN outside of them, and an upright line."""
        count = sum(map(len, self._bars))
        x = np.zeros(3 * count + 2)
        ys = np.full((len(self._bars) + 1, len(x)), np.nan)
        at = 0
        for row, bars in enumerate(self._bars):
            for begin, end, height in bars:
                x[at : at + 3] = begin, end, end
                ys[row, at : at + 2] = height
                at += 3
        x[at:] = now - self._origin
        ys[-1, at:] = -0.5, len(self._rows) - 0.5
        order = np.argsort(x, kind="stable")
        return (x[order], *ys[:, order])

    def update(self, now: float) -> None:
        """Moves the line to a time [s]."""
        self._plot.data = self._data(now)


def _of(events: list[Event], segment: str) -> list[Event]:
    return [event for event in events if event.segment == segment]
