# SPDX-License-Identifier: Apache-2.0
"""Leave one recording out: numbers are chosen on all other files, and judged on the one left out.

The numbers are those of `touchline.tuning` that were chosen while looking at these recordings. Each
may be its default or one of two others, one number at a time.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from touchline.bench.matching import match
from touchline.bench.real.judged import Touched, events_of, judge_touched, link_shares, spans
from touchline.result.event import Event
from touchline.trials.real_recordings import Recording

FLOOR = 1e-3  # probability of the touched link where none is named, and of what a false event says
CHOICES: tuple[Mapping[str, float], ...] = (
    {},
    {"detector.little": 0.35},
    {"detector.little": 0.7},
    {"detector.rest": 2.5},
    {"detector.rest": 10.0},
    {"localizer.crosstalk": 0.75},
    {"localizer.crosstalk": 3.0},
)


@dataclass(frozen=True)
class Tried:
    """A recording with one of the choices.

    Attributes:
        counts: of its touches.
        score: log of the probability that the true links were given, touch by touch.
    """

    counts: Touched
    score: float


def try_all(recording: Recording) -> list[Tried]:
    """A recording with each of `CHOICES`."""
    return [_tried(recording, events_of(recording, choice)) for choice in CHOICES]


def chosen(tried: list[list[Tried]], left_out: int) -> int:
    """Which choice has the best score on all recordings but one.

    The first choice stays unless the best one gains more than the standard error of that gain over
    the recordings: one recording alone chooses nothing (Breiman et al., Classification and
    Regression Trees, 1984, section 3.4.3).
    """
    scores = [[t.score for t in of] for k, of in enumerate(tried) if k != left_out]
    gains = np.array(scores) - np.array(scores)[:, :1]
    best = int(np.argmax(gains.sum(axis=0)))
    if len(gains) < 2:
        return 0
    error = gains[:, best].std(ddof=1) * len(gains) ** 0.5
    return best if gains[:, best].sum() > error else 0


def named(choice: Mapping[str, float]) -> str:
    """A choice in words."""
    return ", ".join(f"{name} {value:g}" for name, value in choice.items()) or "defaults"


def _tried(recording: Recording, events: list[Event]) -> Tried:
    pairs = match(recording.touches, spans(events))
    told = [link_shares(events[e]).get(recording.link, 0.0) for _, e in pairs]
    nothing = len(recording.touches) + len(events) - 2 * len(pairs)  # missed, or false
    score = float(np.log(np.maximum(told, FLOOR)).sum() + nothing * np.log(FLOOR))
    return Tried(judge_touched(recording, events), score)
