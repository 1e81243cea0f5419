# SPDX-License-Identifier: Apache-2.0
"""What really touched the robot, beside a simulated log."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.estimation.samples import Samples

Array = NDArray[np.float64]


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
    link: NDArray[np.int64]
    point: Array
    force: Array
    moment: Array
    wrench_mean: Array
    link_mean: NDArray[np.int64]

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
