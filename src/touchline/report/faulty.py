# SPDX-License-Identifier: Apache-2.0
"""Which channels of a recording were not believed, for how long and why."""

from collections import Counter
from collections.abc import Sequence

from touchline.arrays import Array
from touchline.result.fault import FaultChange
from touchline.result.kinds import Fault

LEAST = 1e-3  # of the samples: a channel that spikes now and then is not told
MOST = 5  # lines


class FaultyChannels:
    """Counts the samples in which each channel was not believed."""

    def __init__(self) -> None:
        self._rows = 0
        self._counts: dict[str, Counter[Fault]] = {}
        self._first: dict[str, float] = {}  # time [s]
        self._now: dict[str, tuple[Fault, int]] = {}  # with the sample at which it began

    def add(self, time: Array, changes: Sequence[FaultChange]) -> None:
        """Take the times (N,) [s] of the next samples, and what changed in them."""
        for change in changes:
            row = self._rows + change.sample
            self._close(change.channel, row)
            if change.fault is not Fault.NONE:
                self._now[change.channel] = change.fault, row
                self._first.setdefault(change.channel, float(time[change.sample]))
        self._rows += len(time)

    def lines(self) -> list[str]:
        """A line for each channel that was not believed for long, the worst first."""
        for channel in list(self._now):
            fault, _ = self._now[channel]
            self._close(channel, self._rows)
            self._now[channel] = fault, self._rows
        worst = sorted(self._counts.items(), key=lambda item: -item[1].total())
        told = []
        for channel, counts in worst:
            share = counts.total() / max(self._rows, 1)
            if share >= LEAST:
                fault = counts.most_common(1)[0][0]
                told.append(
                    f"{channel}: not believed in {100 * share:.3g} % of the samples, first at "
                    f"{self._first[channel]:.3f} s, most often {fault}"
                )
        more = len(told) - MOST
        return [*told[:MOST], *([f"{more} more channels were not believed"] if more > 0 else [])]

    def _close(self, channel: str, row: int) -> None:
        """What lasted until a sample has ended."""
        if channel in self._now:
            fault, began = self._now.pop(channel)
            self._counts.setdefault(channel, Counter())[fault] += row - began
