# SPDX-License-Identifier: Apache-2.0
"""Contacts of a live stream: what a control loop does not ask for is not worked out."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.contact.classification import Classes, Classifier, Kind, of_contact
from touchline.contact.contact import Contact
from touchline.contact.detector import Detection
from touchline.contact.event import Event, load_shares
from touchline.contact.localizer import CONTACT, Answer, Localizer
from touchline.contact.zones import Zones
from touchline.estimation.observer import Estimate

Array = NDArray[np.float64]


class LiveSample:
    """One sample and what was made of it, until the events have taken it."""

    __slots__ = ("time", "q", "estimate", "detection", "answers", "ended", "view", "_classify")

    def __init__(
        self,
        time: float,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        answers: Array,
        ended: Array,
        classify: Callable[[], None],
    ) -> None:
        self.time, self.q, self.estimate, self.detection = time, q, estimate, detection
        self.answers, self.ended = answers, ended
        self.view: tuple[Classes, int] | None = None
        self._classify = classify

    @property
    def classes(self) -> tuple[Classes, int]:
        """The classifier's view of some samples, and which of them this is."""
        if self.view is None:
            self._classify()
            assert self.view is not None  # it was among those that wait
        return self.view


class LiveStream:
    """The samples that the classifier and the events may lag behind."""

    def __init__(self, classifier: Classifier) -> None:
        self._classifier = classifier
        self.samples: list[LiveSample] = []
        self._waiting: list[LiveSample] = []

    def add(
        self,
        time: float,
        q: Array,
        estimate: Estimate,
        detection: Detection,
        answers: Array,
        ended: Array,
    ) -> LiveSample:
        """Takes a sample: joint positions (n,), and what was made of it."""
        sample = LiveSample(time, q, estimate, detection, answers, ended, self.classify)
        self.samples.append(sample)
        self._waiting.append(sample)
        return sample

    def classify(self) -> None:
        """Classifies all samples that wait for it, in their order."""
        waiting, self._waiting = self._waiting, []
        if not waiting:
            return
        rows = np.array([sample.estimate.rows for sample in waiting])
        classes = self._classifier.follow(
            np.array([sample.time for sample in waiting]),
            waiting[0].estimate.like(rows),
            np.array([sample.detection.levels for sample in waiting]),
        )
        for i, sample in enumerate(waiting):
            sample.view = classes, i

    def take(self) -> tuple[list[LiveSample], Classes]:
        """Hands out all samples, classified, and forgets them."""
        self.classify()
        samples, self.samples = self.samples, []
        views = [sample.classes for sample in samples]
        return samples, Classes(
            np.array([view.kinds[i] for view, i in views]),
            np.array([view.clamped[i] for view, i in views]),
            np.array([view.rates[i] for view, i in views]),
        )


def _lazy(work: Callable[["LiveContact"], Any]) -> Any:
    """An attribute that is worked out once, and stands for any declared type."""
    return cached_property(work)


class LiveContact(Contact):
    """A `Contact` whose attributes are worked out when they are asked for."""

    _sample: LiveSample
    _row: Array
    _localizer: Localizer
    _zones: Zones

    def __init__(
        self, sample: LiveSample, row: Array, event: Event, localizer: Localizer, zones: Zones
    ) -> None:
        # Past the frozen dataclass, which would set every attribute.
        self.__dict__.update(
            segment=event.segment,
            event=event.id,
            _sample=sample,
            _row=row,
            _localizer=localizer,
            _zones=zones,
        )

    @cached_property
    def _answer(self) -> Answer:
        return self._localizer.answer(self._row[CONTACT:])

    @cached_property
    def _class(self) -> tuple[int, bool, float]:
        classes, i = self._sample.classes
        at = i, int(self._row[1])
        kind = of_contact(classes.kinds[at], self._share())
        return int(kind), bool(classes.clamped[at]), float(classes.rates[at])

    def _share(self) -> Array:
        """Of the load on the segment; 1 for its only contact."""
        rows = self._sample.answers
        if np.count_nonzero(rows[:, 1] == self._row[1]) < 2:
            return np.ones(())
        sample, segment, _ = rows[:, :CONTACT].astype(int).T
        shares = load_shares(sample, segment, rows[:, CONTACT:])
        return shares[int(np.argmax(rows[:, 2] == self._row[2]))]

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
    level = _lazy(lambda self: "collision" if self._class[0] == Kind.COLLISION else "contact")
    decided = _lazy(lambda self: self._class[0] >= Kind.CONTACT)
    clamped = _lazy(lambda self: self._clamped())
    rate = _lazy(lambda self: self._class[2])
    wrench = _lazy(lambda self: self._wrench())

    def _clamped(self) -> bool | None:
        return True if self._class[1] else None if self.status == "not_separable" else False

    def _wrench(self) -> Array | None:
        if self.segment == "root":
            return None
        return self._sample.estimate.segment_wrench[int(self._row[1])]
