# SPDX-License-Identifier: Apache-2.0
"""The contacts of a recording as columns: one row per contact and sample."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.localizer.answer import (
    COVARIANCE,
    FORCE,
    HEAD,
    POSITION,
    PROBABILITY,
    STATUS,
    SURFACE,
)
from touchline.localizer.localizer import Localizer

Array = NDArray[np.float64]

UPPER = {"pxx": 0, "pxy": 1, "pxz": 2, "pyy": 4, "pyz": 5, "pzz": 8}


@dataclass(frozen=True)
class ContactTable:
    """M rows in the order of the samples.

    Attributes:
        sample: (M,) index of the sample in its part of the recording.
        segment: (M,) index of the segment.
        event: (M,) number of the event.
        answers: (M, w) native answers, see `Localizer.answer`.
        localizer: that made them.
    """

    sample: NDArray[np.int64]
    segment: NDArray[np.int64]
    event: NDArray[np.int64]
    answers: Array
    localizer: Localizer

    @staticmethod
    def empty(localizer: Localizer) -> "ContactTable":
        """No contacts."""
        none = np.empty(0, dtype=np.int64)
        return ContactTable(none, none, none, np.empty((0, HEAD)), localizer)

    def __len__(self) -> int:
        return len(self.sample)

    def columns(self) -> dict[str, NDArray]:
        """Columns as in `contacts.parquet`, without `time` and `health`.

        Names are objects, None where there is no honest answer; numbers are NaN there. The force is
        that of the contact where it is located, and the segment's where it is not.
        """
        answers = self.answers
        status = answers[:, 0].astype(int)
        placed = (status == STATUS.index("located")) | (status == STATUS.index("ambiguous"))
        robot, patches = self.localizer.robot, self.localizer.skin.patches
        surface = np.where(placed, answers[:, SURFACE], -1).astype(int)
        covariance = np.where(placed[:, None], answers[:, COVARIANCE], np.nan)
        position = np.where(placed[:, None], answers[:, POSITION], np.nan)
        variance = covariance[:, [0, 4, 8]].sum(axis=1)
        return {
            "event": self.event,
            "segment": _names(robot.segment_names, self.segment),
            "link": _names([patch.link for patch in patches], surface),
            "body": _names([patch.body for patch in patches], surface),
            "body_probability": np.where(placed, answers[:, PROBABILITY], np.nan),
            "status": _names(STATUS, np.where(status == 0, STATUS.index("wrench_only"), status)),
            **dict(zip("xyz", position.T, strict=True)),
            **dict(zip(("fx", "fy", "fz"), answers[:, FORCE].T, strict=True)),
            "position_std": np.sqrt(np.maximum(variance, 0.0)),
            **{name: covariance[:, i] for name, i in UPPER.items()},
        }


def _names(names, index: NDArray[np.int64]) -> NDArray[np.object_]:
    """The name at each index; None for -1."""
    return np.array([*names, None], dtype=object)[index]
