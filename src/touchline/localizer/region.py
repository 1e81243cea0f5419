# SPDX-License-Identifier: Apache-2.0
"""The posterior of a contact's place over the links and their surfaces, cell by cell."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array, Index, Mask
from touchline.localizer.skin import Skin


@dataclass(frozen=True)
class Region:
    """Small pieces of the surfaces, with the probability that the contact is on each.

    Attributes:
        links: names of the links, which `link` indexes.
        link: (m,) index of the link that carries each piece.
        points: (m, 3) [m] middle of each piece, in world.
        probability: (m,) of each piece; they sum to one.
        density: (m,) probability per area [1/m2].
    """

    links: tuple[str, ...]
    link: Index
    points: Array
    probability: Array
    density: Array

    @staticmethod
    def of(skin: Skin, cells: Array) -> "Region":
        """From native cells: surface, centre, probability, log of the density."""
        return Region(
            tuple(patch.link for patch in skin.patches),
            cells[:, 0].astype(int),
            cells[:, 1:4],
            cells[:, 4],
            np.exp(cells[:, 5]),
        )

    def level(self, link: str, point: ArrayLike) -> float:
        """Probability of the smallest highest-posterior region that holds a point of a link.

        If the posterior is calibrated it is uniform between 0 and 1 over many contacts: below 0.9
        for 90 % of the true places.

        Args:
            link: name of the link.
            point: (3,) [m] on its surface, in world.

        Returns:
            1 where nothing speaks for that link.
        """
        own = np.flatnonzero(self.link == self.links.index(link)) if link in self.links else []
        if not len(own):
            return 1.0
        distance = np.linalg.norm(self.points[own] - np.asarray(point, float), axis=1)
        here = own[int(np.argmin(distance))]
        denser = self.density > self.density[here]
        return float(self.probability[denser].sum() + 0.5 * self.probability[here])

    def contains(self, link: str, point: ArrayLike, probability: float = 0.9) -> bool:
        """Is a point of a link in the highest-posterior region of this probability?"""
        return self.level(link, point) <= probability

    def largest(self, probability: float = 0.9) -> Mask:
        """(m,) the pieces that make up the highest-posterior region of this probability."""
        order = np.argsort(-self.density)
        inside = np.zeros(len(order), dtype=bool)
        count = int(np.searchsorted(np.cumsum(self.probability[order]), probability)) + 1
        inside[order[:count]] = True
        return inside
