# SPDX-License-Identifier: Apache-2.0
"""Timing of candidates in turns, so that whatever else the machine does hits all of them alike."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Candidate:
    """Something to time: `work` treats `samples` samples per call."""

    name: str
    work: Callable[[], object]
    samples: int


@dataclass(frozen=True)
class Timing:
    """Time per sample [us] over all rounds."""

    name: str
    median: float
    minimum: float


def measure(candidates: Sequence[Candidate], rounds: int) -> list[Timing]:
    """Times every candidate once per round, each after one call of its own that does not count.

    What another candidate has left in the caches is then no part of it.

    Args:
        candidates: what to time, in the order of a round.
        rounds: how many rounds, at least 1.
    """
    spent = np.empty((rounds, len(candidates)))
    for row in spent:
        for i, candidate in enumerate(candidates):
            candidate.work()
            start = time.perf_counter()
            candidate.work()
            row[i] = (time.perf_counter() - start) / candidate.samples * 1e6
    middle, least = np.median(spent, axis=0), spent.min(axis=0)
    return [
        Timing(c.name, float(m), float(x))
        for c, m, x in zip(candidates, middle, least, strict=True)
    ]
