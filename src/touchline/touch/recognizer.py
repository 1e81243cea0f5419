# SPDX-License-Identifier: Apache-2.0
"""Reads strokes: digits, letters or any signs, learnt from a few examples each."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.touch.stroke import Stroke, resampled

POINTS = 16  # of a normalized stroke; with 32 as many digits of unseen writers are read
DIRECTIONS = 1.0  # weight of directions beside places; half and double: 0.2 % fewer are read
VARIANTS = ((0.0, 0.0), (0.12, 0.0), (-0.12, 0.0), (0.0, 0.2), (0.0, -0.2))
# (turn [rad], slant) of each example: hands differ by as much; without 0.6 % fewer are read
NEAREST = 7  # examples that vote
SOFT = 0.6  # of the distance to the nearest example, over which a vote falls to exp(-1/2)
LEAST_WAY = 1e-6  # m; a shorter stroke is a point


class Recognizer:
    """Names what was written by the examples that resemble it most.

    A stroke is moved and scaled to unit size, cut into points at equal distances, and compared by
    places and directions along the way. It is not turned: a 6 is no 9.
    """

    def __init__(self) -> None:
        self._features = np.empty((0, 4 * POINTS))
        self._labels: list[str] = []

    @property
    def labels(self) -> tuple[str, ...]:
        """All that it can read."""
        return tuple(dict.fromkeys(self._labels))

    def learn(self, strokes: Sequence[Stroke | ArrayLike], labels: Sequence[str]) -> None:
        """Adds examples.

        Args:
            strokes: `Stroke`s, or ways (N, 2) of any unit.
            labels: what they say.

        Raises:
            ValueError: unequal numbers, or a stroke with fewer than two distinct points.
        """
        if len(strokes) != len(labels):
            raise ValueError(f"{len(strokes)} strokes, {len(labels)} labels: one each is needed")
        if not len(strokes):
            return
        for turn, slant in VARIANTS:
            T = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
            T = T @ np.array([[1.0, slant], [0.0, 1.0]])
            features = np.array([_features(_way(stroke) @ T.T) for stroke in strokes])
            self._features = np.vstack([self._features, features])
            self._labels += [str(label) for label in labels]

    def read(self, stroke: Stroke | ArrayLike) -> list[tuple[str, float]]:
        """What a stroke says: (label, probability), best first; empty if nothing was learnt.

        Raises:
            ValueError: a stroke with fewer than two distinct points.
        """
        if not self._labels:
            return []
        distance = np.linalg.norm(self._features - _features(_way(stroke)), axis=1)
        nearest = np.argsort(distance, kind="stable")[:NEAREST]
        near = distance[nearest]
        votes = np.exp(-0.5 * ((near - near[0]) / (SOFT * max(near[0], 1e-9))) ** 2)
        sums: dict[str, float] = {}
        for i, vote in zip(nearest.tolist(), votes.tolist(), strict=True):
            sums[self._labels[i]] = sums.get(self._labels[i], 0.0) + vote
        total = sum(sums.values())
        return sorted(((k, v / total) for k, v in sums.items()), key=lambda pair: -pair[1])


def _way(stroke: Stroke | ArrayLike) -> Array:
    way = stroke.points[:, 1:] if isinstance(stroke, Stroke) else np.asarray(stroke, float)
    if way.ndim != 2 or way.shape[1] != 2 or not np.isfinite(way).all():
        raise ValueError("a stroke has finite points (N, 2)")
    return way


def _features(way: Array) -> Array:
    """Places and directions (4 POINTS,) of a way, independent of where it is and how large."""
    size = float(np.ptp(way, axis=0).max()) if len(way) > 1 else 0.0
    if size < LEAST_WAY:
        raise ValueError("the stroke is a single point: there is nothing to read")
    even = resampled(way, POINTS)
    even = (even - even.mean(axis=0)) / size
    along = np.gradient(even, axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    return np.concatenate([even.ravel(), 2.0 * DIRECTIONS / np.sqrt(POINTS) * along.ravel()])
