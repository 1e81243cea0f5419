# SPDX-License-Identifier: Apache-2.0
"""What really touched the robot of a simulated log; never read by what estimates."""

import json
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.logs.parquet import damages, first_line


@dataclass(frozen=True)
class TrueContact:
    """One contact of the truth, from beginning to end.

    Attributes:
        link: that is touched.
        time: (N,) [s]; `point` (N, 3) [m] and `force` (N, 3) [N], world.
    """

    link: str
    time: Array
    point: Array
    force: Array

    @property
    def strength(self) -> float:
        """Largest force [N]."""
        return float(np.linalg.norm(self.force, axis=1).max())

    @property
    def mean_force(self) -> Array:
        """Force (3,) [N], mean over the samples near the peak."""
        norms = np.linalg.norm(self.force, axis=1)
        return self.force[norms >= 0.9 * norms.max()].mean(axis=0)

    def lasts_at(self, time: float) -> bool:
        """Whether the link is touched at a time [s]."""
        return bool(self.time[0] <= time <= self.time[-1])

    def point_at(self, time: float) -> Array:
        """Point (3,) [m] at a time [s] of the contact."""
        return self.point[self._row(time)]

    def force_at(self, time: float) -> Array:
        """Force (3,) [N] at a time [s] of the contact."""
        return self.force[self._row(time)]

    def _row(self, time: float) -> int:
        return min(int(np.searchsorted(self.time, time)), len(self.time) - 1)


def read_truth(log: Path) -> list[TrueContact]:
    """The true contacts of a simulated Parquet log, in the order of their beginning.

    Empty for a log without truth, as those of real robots are.

    Raises:
        InputError: the file is damaged.
    """
    import pyarrow.parquet as pq

    if log.suffix != ".parquet":
        return []
    try:
        schema = pq.read_schema(log)
        slots = [i for i in range(len(schema.names)) if set(_columns(i)) <= set(schema.names)]
        links = _links(schema.metadata or {})
        contacts = [contact for slot in slots for contact in _contacts(log, slot, links)]
    except damages() as error:
        raise InputError(f"{log}: its truth is damaged: {first_line(error)}") from error
    return sorted(contacts, key=lambda contact: contact.time[0])


def _columns(slot: int) -> list[str]:
    prefix = f"truth.contact.{slot}"
    return [f"{prefix}.link", *(f"{prefix}.{part}{axis}" for part in ("", "f") for axis in "xyz")]


def _links(metadata: dict[bytes, bytes]) -> list[str]:
    """The names that the numbers of links mean; none where nobody has left them."""
    for value in metadata.values():
        with suppress(ValueError):  # others leave what they like
            found = json.loads(value)
            if isinstance(found, dict) and "truth.links" in found:
                return found["truth.links"]
    return []


def _contacts(log: Path, slot: int, links: list[str]) -> list[TrueContact]:
    """Those of one slot; copies, so that an hour of nothing is not kept in memory."""
    import pyarrow.parquet as pq

    def columns(*names: str) -> Array:
        table = pq.read_table(log, columns=list(names))
        return np.stack([np.asarray(table.column(name), float) for name in names], axis=1)

    number, *axes = _columns(slot)
    told = columns(number)[:, 0]
    link = np.where((told >= 0) & (told < len(links)), told, -1).astype(int)
    edges = np.flatnonzero(np.diff(link, prepend=-1, append=-1))
    spans = [(i, j) for i, j in zip(edges[:-1], edges[1:], strict=True) if link[i] >= 0]
    if not spans:
        return []
    rows = columns("time", *axes)
    found = []
    for i, j in spans:
        time, point, force = np.split(rows[i:j].copy(), [1, 4], axis=1)
        found.append(TrueContact(links[link[i]], time[:, 0], point, force))
    return found
