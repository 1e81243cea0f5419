# SPDX-License-Identifier: Apache-2.0
"""What really touched the robot, beside a simulated log."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from touchline.arrays import Array, Index
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Touch


@dataclass(frozen=True)
class Truth:
    """Contacts of N samples in c slots; slot i is always the i-th contact of the scenario.

    Attributes:
        links: names that `link` counts in.
        link: (N, c) index into `links`, -1 where there is no contact.
        point: (N, c, 3) world [m], NaN where there is no contact.
        force: (N, c, 3) on the robot, world axes [N], 0 where there is no contact.
        moment: (N, c, 3) about the point, world axes [Nm].
        wrench_mean: (N, c, 6) mean since the sample before, world axes, about the world origin
            [N, Nm]: what a discrete filter of the truth must be fed with.
        link_mean: (N, c) the link that `wrench_mean` acted on, -1 where none did.
    """

    links: tuple[str, ...]
    link: Index
    point: Array
    force: Array
    moment: Array
    wrench_mean: Array
    link_mean: Index

    def columns(self) -> dict[str, Array]:
        """The log's columns `truth.contact.K.*`, (N,) each."""
        columns: dict[str, Array] = {}
        for c in range(self.link.shape[1]):
            name = f"truth.contact.{c}"
            columns[f"{name}.link"] = self.link[:, c].astype(float)
            for a, axis in enumerate("xyz"):
                columns[f"{name}.{axis}"] = self.point[:, c, a]
                columns[f"{name}.f{axis}"] = self.force[:, c, a]
                columns[f"{name}.m{axis}"] = self.moment[:, c, a]
        return columns

    def segment_wrench_mean(self, segments: tuple[str, ...], by_link: dict[str, str]) -> Array:
        """Mean wrench (N, m, 6) on each segment since the sample before, world, about the origin.

        Args:
            segments: names (m,).
            by_link: link -> name of its segment.
        """
        out = np.zeros((len(self.link), len(segments), 6))
        for s, segment in enumerate(segments):
            own = [i for i, link in enumerate(self.links) if by_link.get(link) == segment]
            out[:, s] = np.einsum("nc,ncw->nw", np.isin(self.link_mean, own), self.wrench_mean)
        return out


@dataclass(frozen=True)
class Simulated:
    """A simulated recording: what the robot logs, and the truth.

    Attributes:
        samples: as logged, for `Observer.run` or a log file.
        truth: the contacts.
        metadata: scenario, seed, rates and whatever else describes the run; JSON values.
    """

    samples: Samples
    truth: Truth
    metadata: dict[str, Any] = field(default_factory=dict)


class TruthRecorder:
    """Collects a run's truth: at the log's instants, and the means over the time between."""

    def __init__(self, links: tuple[str, ...], slots: int, stride: int) -> None:
        self._links, self._slots = links, slots
        self._index = {name: i for i, name in enumerate(links)}
        self._weight = 0.5 / stride
        self.make_room(0)
        self._clear()

    def make_room(self, rows: int) -> None:
        """For the next samples; the means over the time since the last one go on."""
        none = np.full((rows, self._slots), -1)
        three = (rows, self._slots, 3)
        self.truth = Truth(
            self._links,
            none,
            np.full(three, np.nan),
            np.zeros(three),
            np.zeros(three),
            np.zeros((rows, self._slots, 6)),
            none.copy(),
        )

    def _clear(self) -> None:
        self._sum = np.zeros((self._slots, 6))
        self._touched = [-1] * self._slots
        self._any = False

    def add(self, touches: list[Touch]) -> None:
        """What acts at either end of a physics step counts half."""
        for slot, touch in enumerate(touches):
            if touch.active:
                self._sum[slot] += self._weight * touch.wrench()
                self._touched[slot] = self._index[touch.link]
                self._any = True

    def close(self, row: int) -> None:
        """Stores the means up to a sample; to be called before anything of the next is added."""
        if self._any:  # else there is nothing but what the room was made with
            self.truth.wrench_mean[row], self.truth.link_mean[row] = self._sum, self._touched
            self._clear()

    def put(self, row: int, before: list[Touch], after: list[Touch]) -> None:
        """Stores a sample: the mean of just before and just after the inputs have changed."""
        truth = self.truth
        for slot, (a, b) in enumerate(zip(before, after, strict=True)):
            shown = b if b.active or not a.active else a
            if shown.active:
                truth.link[row, slot] = self._index[shown.link]
                truth.point[row, slot] = shown.point
                truth.force[row, slot] = (a.force + b.force) / 2
                truth.moment[row, slot] = (a.moment + b.moment) / 2


def filter_truth(mean: Array, time: Array, bandwidth: float) -> Array:
    """The observer's own low-pass of a known signal, to compare its estimates with.

    Args:
        mean: (N, ...) means since the sample before; the first is not used.
        time: (N,) [s].
        bandwidth: K [rad/s].

    Returns:
        (N, ...), 0 at the first sample; the pole is Tustin's up to
        K dt = 0.5 and exp(-K dt) above.
    """
    out = np.zeros_like(mean)
    for i in range(1, len(mean)):
        x = bandwidth * (time[i] - time[i - 1])
        a = (1 - x / 2) / (1 + x / 2) if x <= 0.5 else np.exp(-x)
        out[i] = a * out[i - 1] + (1 - a) * mean[i]
    return out
