# SPDX-License-Identifier: Apache-2.0
"""The rows of `contacts.parquet`: one per contact and sample."""

from typing import Any

import numpy as np

from touchline.contact.detector import Detection
from touchline.contact.event import Event
from touchline.estimation.observer import Estimate
from touchline.model.description import AXES
from touchline.model.robot import Robot

POSITION = ("x", "y", "z")
COVARIANCE = ("pxx", "pxy", "pxz", "pyy", "pyz", "pzz")
CONTACT_SCHEMA: dict[str, Any] = (
    {"time": "f8", "health": "u4", "event": "i8", "segment": "str", "link": "str", "body": "str"}
    | {"body_probability": "f8", "status": "str"}
    | dict.fromkeys((*POSITION, *AXES, "position_std", *COVARIANCE), "f8")
)


class ContactRows:
    """Finds, part by part, the samples at which a segment is touched.

    Until a contact is located its row holds the segment's wrench, moments about the world origin,
    and `wrench_only`.
    """

    def __init__(self, robot: Robot) -> None:
        self._segments = robot.segment_names
        self._begun = np.zeros(len(self._segments), dtype=int)
        self._active = np.zeros(len(self._segments), dtype=bool)

    def rows(
        self,
        time: np.ndarray,
        estimate: Estimate,
        detection: Detection,
        events: list[Event],
        located: Any = None,
    ) -> dict[str, Any]:
        """The columns of `CONTACT_SCHEMA` for N samples.

        Args:
            time: (N,) stamps [s].
            estimate: of these samples.
            detection: of these samples.
            events: all so far.
            located: where the contacts are, if the pipeline tells: an object with `sample` and
                `segment` (M,) and `columns()`, which replace those found here.
        """
        active = detection.levels > 0
        sample, segment = np.nonzero(active)
        ids = self._event_ids(active, events)[sample, segment]
        if located is not None:
            sample, segment = located.sample, located.segment
        columns = self._empty(len(sample))
        columns["time"], columns["health"] = time[sample], estimate.health[sample].astype("u4")
        columns["segment"] = np.array(self._segments, dtype=object)[segment]
        wrenches = estimate.segment_wrench[sample, segment]
        columns |= {axis: wrenches[:, i] for i, axis in enumerate(AXES)}
        return columns | ({"event": ids} if located is None else located.columns())

    def _empty(self, rows: int) -> dict[str, Any]:
        columns: dict[str, Any] = {
            name: [None] * rows if kind == "str" else np.full(rows, np.nan)
            for name, kind in CONTACT_SCHEMA.items()
        }
        return columns | {"status": ["wrench_only"] * rows}

    def _event_ids(self, active: np.ndarray, events: list[Event]) -> np.ndarray:
        """The event of each sample and segment: the n-th rise of a segment is its n-th event."""
        rises = active & ~np.vstack([self._active, active[:-1]])
        number = self._begun + np.cumsum(rises, axis=0) - 1
        ids = np.full(active.shape, -1)
        for g, name in enumerate(self._segments):
            own = np.array([event.id for event in events if event.segment == name], dtype=int)
            where = active[:, g]
            ids[where, g] = own[number[where, g]]
        if len(active):
            self._begun, self._active = self._begun + rises.sum(axis=0), active[-1]
        return ids
