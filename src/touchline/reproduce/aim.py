# SPDX-License-Identifier: Apache-2.0
"""Places on the arm that can be pushed in a given direction."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from touchline.errors import InputError
from touchline.simulation.places import FRICTION, Place, PlaceFinder
from touchline.simulation.touchable import CLEARANCE

TRIES = 5000


def place_along(
    finder: PlaceFinder,
    links: Sequence[str],
    direction: ArrayLike,
    span: tuple[float, float] = (0.0, 0.0),
    clearance: float = CLEARANCE,
    either_way: bool = True,
) -> Place:
    """A place of some links that a force along a direction pushes into, within the friction cone.

    Args:
        finder: draws the places.
        links: one of which is touched.
        direction: (3,) of the force, in world.
        span: from when to when it can be pushed [s].
        clearance: free along the outward normal [m].
        either_way: against the direction will do as well.

    Raises:
        InputError: there is no such place.
    """
    unit = np.asarray(direction, float) / np.linalg.norm(direction)
    for _ in range(TRIES):
        place = finder.find(links, *span, clearance)
        cosine = float(place.direction @ unit)
        if (abs(cosine) if either_way else cosine) >= 1.0 / np.sqrt(1.0 + FRICTION**2):
            return Place(place.at, np.sign(cosine) * unit)
    raise InputError(f"no place on {', '.join(links)} can be pushed along {unit}")
