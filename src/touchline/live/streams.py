# SPDX-License-Identifier: Apache-2.0
"""What arrives of a robot, stream by stream: rate, age, what was lost, and the state it is in."""

from collections import deque
from enum import StrEnum
from statistics import median

import numpy as np

STALE_PERIODS = 3.0  # without a sample: one may be lost and the next be late
SHORTEST_STALE = 0.010  # s; below it the jitter of an ordinary network would be told as a fault
LONGEST_STALE = 1.0  # s; a stream that is slower than 3 Hz is of no use
LATE = 0.015  # s behind the least lag so far; an ordinary network varies by less
SLOW_SHARE = 0.8  # of the rate that was expected
RATE_WINDOW = 64  # samples over which rate and losses are judged
LOST_SHARE = 0.05  # of these samples
SET_BACK = 1.0  # s: a stamp further back is a clock that was set, not a sample that comes late
LAG_FORGETS = 1e-4  # s per s by which clocks may drift apart


class StreamState(StrEnum):
    """Whether a stream can be used."""

    OK = "ok"
    NOT_RECEIVED = "not received"  # nothing has come since the start
    SLOW = "slow"  # too few samples come, or they come late
    STALE = "stale"  # nothing comes any more
    INVALID = "invalid"  # what comes is no number


class Stream:
    """One stream: a topic, or all that one connection brings.

    Args:
        name: for messages.
        period: between samples [s], where it is known beforehand.

    Attributes:
        received: number of samples.
        lost: number of samples that the source counted and that did not come.
        refused: number of samples that came again or too late to be used.
    """

    def __init__(self, name: str, period: float | None = None) -> None:
        self.name, self._expected = name, period
        self.received = self.lost = self.refused = 0
        self._recent: deque[tuple[float, int]] = deque(maxlen=RATE_WINDOW)  # arrival, lost
        self._steps: deque[float] = deque(maxlen=RATE_WINDOW)  # of the sensors' clock [s]
        self._time: float | None = None
        self._least_lag = np.inf
        self._lag = 0.0
        self._valid = True

    def receive(self, time: float, arrival: float, valid: bool = True, lost: int = 0) -> None:
        """Notes a sample.

        Args:
            time: of the sensor's clock [s].
            arrival: on this machine's clock [s].
            valid: whether it can be used.
            lost: how many before it did not come.
        """
        self.received += 1
        self.lost += lost
        self._valid = valid
        self._recent.append((arrival, lost))
        step = 0.0 if self._time is None else time - self._time
        if -SET_BACK < step <= 0.0 and self._time is not None:
            return  # it came twice, or after a later one
        if step > 0.0:
            self._steps.append(step / (1 + lost))
            self._least_lag += LAG_FORGETS * step
        else:  # the first one, or the clock was set back: its lag is another
            self._least_lag = np.inf
        self._time = time
        lag = arrival - time
        self._least_lag = min(self._least_lag, lag)
        self._lag = lag - self._least_lag

    def restart(self) -> None:
        """The link is a new one: its clock and its rate are judged anew."""
        self._recent.clear()
        self._steps.clear()
        self._time, self._least_lag, self._lag = None, np.inf, 0.0

    def forget_lag(self) -> None:
        """The source has given up catching up: what comes now is as prompt as it can be."""
        self._least_lag, self._lag = np.inf, 0.0

    @property
    def period(self) -> float | None:
        """Between samples [s]: as known beforehand, else the median so far."""
        if self._expected is not None or len(self._steps) < 3:
            return self._expected
        return median(self._steps)

    @property
    def patience(self) -> float:
        """The stream is stale when nothing has come for so long [s]."""
        period = self.period or 0.0
        return min(max(STALE_PERIODS * period, SHORTEST_STALE), LONGEST_STALE)

    @property
    def rate(self) -> float:
        """Samples a second, over the last ones [Hz]; by their stamps where all came at once."""
        if len(self._recent) < 2:
            return 0.0
        span = self._recent[-1][0] - self._recent[0][0]
        if span > 0.0:
            return (len(self._recent) - 1) / span
        return 1.0 / self.period if self.period else 0.0

    @property
    def lag(self) -> float:
        """By how much samples come later than the promptest one did [s]."""
        return self._lag

    def age(self, now: float) -> float:
        """Since the last sample came [s]; infinite where none has."""
        return now - self._recent[-1][0] if self._recent else np.inf

    def state(self, now: float) -> StreamState:
        """The state at a time of this machine's clock [s]."""
        if not self._recent:
            return StreamState.STALE if self.received else StreamState.NOT_RECEIVED
        if self.age(now) > self.patience:
            return StreamState.STALE
        if not self._valid:
            return StreamState.INVALID
        return StreamState.SLOW if self._slow() else StreamState.OK

    def _slow(self) -> bool:
        if self._lag > LATE:
            return True
        if len(self._recent) < RATE_WINDOW:
            return False
        lost = sum(lost for _, lost in self._recent)
        if lost > LOST_SHARE * RATE_WINDOW:
            return True
        return self._expected is not None and self.rate * self._expected < SLOW_SHARE

    def describe(self, now: float) -> str:
        """One line: state, rate, age and losses."""
        state = self.state(now)
        parts = [f"{self.name}: {state}"]
        if self.received:
            parts.append(f"{self.rate:.0f} Hz, last {1e3 * self.age(now):.0f} ms ago")
            parts.append(f"{self.received} received, {self.lost} lost, {self.refused} refused")
        return ", ".join(parts)
