# SPDX-License-Identifier: Apache-2.0
"""Where a replay is, and how fast it goes on."""

from collections.abc import Sequence

from touchline.result.event import Event


class Player:
    """The time of a replay.

    Args:
        start: first time [s].
        end: last time [s].
        events: in the order of their detection.

    Attributes:
        time: that is shown [s].
        playing: whether it goes on.
        speed: seconds of the recording per second.
    """

    def __init__(self, start: float, end: float, events: Sequence[Event] = ()) -> None:
        self.start, self.end = start, end
        self.events = sorted(events, key=lambda event: event.detected)
        self.time, self.playing, self.speed = start, False, 1.0

    def play(self) -> None:
        """Goes on, from the beginning if it stands at the end."""
        if self.time >= self.end:
            self.time = self.start
        self.playing = True

    def seek(self, time: float) -> None:
        """Goes to a time [s], or to the nearest there is."""
        self.time = min(max(time, self.start), self.end)

    def advance(self, seconds: float) -> None:
        """So many seconds have passed; it stops at the end."""
        if not self.playing:
            return
        self.seek(self.time + self.speed * seconds)
        if self.time >= self.end:
            self.playing = False

    def show(self, event: Event) -> None:
        """Stops in the middle of an event, of that part of it which told its place."""
        self.playing = False
        self.seek(self._shown_at(event))

    def neighbour(self, step: int) -> Event | None:
        """The next event (`step` 1) or the one before (-1), seen from the time shown."""
        if step > 0:
            return next((e for e in self.events if e.detected > self.time), None)
        over = [e for e in self.events if self._shown_at(e) < self.time]
        return over[-1] if over else None

    def _shown_at(self, event: Event) -> float:
        last = event.time_of_position
        if last is None:
            last = self.end if event.cleared is None else event.cleared
        return (event.detected + last) / 2
