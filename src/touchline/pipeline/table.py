# SPDX-License-Identifier: Apache-2.0
"""The contacts of a recording as columns: one row per contact and sample."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array, Index
from touchline.result.contact import Contact
from touchline.result.native import CONTACT, Names, names_of
from touchline.value import Field

LEFT_OUT = "-"  # a number of a field that has no column


def contact_schema() -> dict[str, str]:
    """Type of each column of a contact: "f8", "i8" or "str"."""
    return {
        column: {"number": "f8", "vector": "f8", "count": "i8"}.get(field.kind, "str")
        for field in CONTACT
        for column in field.columns
        if column != LEFT_OUT
    }


@dataclass(frozen=True)
class ContactTable:
    """M rows in the order of the samples; `table[i]` is a `Contact`.

    Attributes:
        sample: (M,) index of the sample in its part of the recording.
        numbers: (M, w) of the core, see `touchline.result.native`.
        names: of the robot.
    """

    sample: Index
    numbers: Array
    names: Names

    @staticmethod
    def empty(names: Names) -> "ContactTable":
        """No contacts."""
        width = CONTACT[-1].begin + CONTACT[-1].size
        return ContactTable(np.empty(0, dtype=np.int64), np.empty((0, width)), names)

    def __len__(self) -> int:
        return len(self.sample)

    def __getitem__(self, row: int) -> Contact:
        return Contact.of(self.numbers[row], self.names)

    def __iter__(self) -> Iterator[Contact]:
        return (self[row] for row in range(len(self)))

    @property
    def segment(self) -> Index:
        """(M,) index of the segment."""
        return self._field("segment")[:, 0].astype(np.int64)

    @property
    def event(self) -> Index:
        """(M,) number of the event."""
        return self._field("event")[:, 0].astype(np.int64)

    @property
    def level(self) -> Index:
        """(M,) index of the level in `touchline.result.native.LEVELS`."""
        return self._field("level")[:, 0].astype(np.int64)

    @property
    def position(self) -> Array:
        """(M, 3) [m] in world; NaN where there is no honest answer."""
        return self._field("position")

    def columns(self) -> dict[str, NDArray]:
        """Columns as in `contacts.parquet`, without `time` and `health`.

        Names are objects, None where there is no honest answer; numbers are NaN there. The force is
        that of the contact where it is located, and the segment's where it is not; the moment is
        the segment's about the world origin.
        """
        return {
            column: self._column(field, i)
            for field in CONTACT
            for i, column in enumerate(field.columns)
            if column != LEFT_OUT
        }

    def _field(self, name: str) -> Array:
        field = next(field for field in CONTACT if field.name == name)
        return self.numbers[:, field.begin : field.begin + field.size]

    def _column(self, field: Field, i: int) -> NDArray:
        numbers = self.numbers[:, field.begin + i]
        if field.kind in ("number", "vector"):
            return numbers
        if field.kind == "count":
            return numbers.astype(np.int64)
        names = names_of(field.kind, self.names) or ()
        words = [None if name is None else str(name) for name in names]
        return np.array(words, dtype=object)[numbers.astype(np.int64)]
