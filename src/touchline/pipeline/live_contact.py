# SPDX-License-Identifier: Apache-2.0
"""Contacts of a live stream: what a control loop does not ask for is not worked out."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from math import isnan
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.classifier.classifier import Kind
from touchline.classifier.zones import Zones
from touchline.detector.detector import Detection
from touchline.localizer.answer import ANSWER, CLAMPED, KIND, RATE, SEGMENT, Answer
from touchline.localizer.localizer import Localizer
from touchline.observer.observer import Estimate
from touchline.result.contact import Contact
from touchline.result.event import Event

Array = NDArray[np.float64]

LEVELS = ("contact", "contact", "contact", "collision")  # of each `Kind`


@dataclass(frozen=True, slots=True)
class LiveSample:
    """One sample and what was made of it, until the events have taken it.

    Attributes:
        time: [s].
        q: (n,) [rad or m].
        estimate: of the observer.
        detection: of the detector.
        contacts: (M, w) and `ended`, see `Localizer.follow`.
    """

    time: float
    q: Array
    estimate: Estimate
    detection: Detection
    contacts: Array
    ended: Array


def _lazy(work: Callable[["LiveContact"], Any]) -> Any:
    """An attribute that is worked out once, and stands for any declared type."""
    return cached_property(work)


class LiveContact(Contact):
    """A `Contact` whose attributes are worked out when they are asked for."""

    _row: Array
    _estimate: Estimate
    _localizer: Localizer
    _zones: Zones

    def __init__(
        self, row: Array, estimate: Estimate, event: Event, localizer: Localizer, zones: Zones
    ) -> None:
        # Past the frozen dataclass, which would set every attribute.
        self.__dict__.update(
            segment=event.segment,
            event=event.id,
            _row=row,
            _estimate=estimate,
            _localizer=localizer,
            _zones=zones,
        )

    @cached_property
    def _answer(self) -> Answer:
        return self._localizer.answer(self._row[ANSWER:])

    status = _lazy(lambda self: self._answer.status or "wrench_only")
    link = _lazy(lambda self: self._answer.link)
    body = _lazy(lambda self: self._answer.body)
    body_probability = _lazy(lambda self: self._answer.body_probability)
    position = _lazy(lambda self: self._answer.position)
    force = _lazy(lambda self: self._answer.force)
    covariance = _lazy(lambda self: self._answer.covariance)
    candidates = _lazy(lambda self: self._answer.candidates)
    rank = _lazy(lambda self: self._answer.rank)
    unknowns = _lazy(lambda self: self._answer.unknowns)
    zone = _lazy(lambda self: self._zones.of(self.segment, self.link))
    level = _lazy(lambda self: LEVELS[int(self._row[KIND])])
    decided = _lazy(lambda self: int(self._row[KIND]) >= Kind.CONTACT)
    clamped = _lazy(lambda self: self._clamped())
    rate = _lazy(lambda self: float(self._row[RATE]))
    wrench = _lazy(lambda self: self._wrench())

    def _clamped(self) -> bool | None:
        clamped = float(self._row[CLAMPED])
        return None if isnan(clamped) else clamped > 0.0

    def _wrench(self) -> Array | None:
        if self.segment == "root":
            return None
        return self._estimate.segment_wrench[int(self._row[SEGMENT])]
