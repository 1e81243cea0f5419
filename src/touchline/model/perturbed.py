# SPDX-License-Identifier: Apache-2.0
"""Arms that are not as their model says."""

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from touchline.model.mechanism import Inertia, Mechanism
from touchline.model.transforms import rotation_rpy


def perturbed(
    mechanism: Mechanism,
    fraction: float,
    rng: np.random.Generator,
    links: Collection[str] | None = None,
) -> Mechanism:
    """A mechanism whose inertias are not what the model says.

    Args:
        mechanism: as modelled.
        fraction: 1 sigma of the relative error of masses and inertias; centres of mass move by
            `fraction` times 0.1 m, axes of inertia turn by `fraction` rad.
        rng: draws the errors.
        links: only of these links; default: of all.
    """
    found = {
        name: link
        if links is not None and name not in links
        else replace(link, inertia=_perturbed_inertia(link.inertia, fraction, rng))
        for name, link in mechanism.links.items()
    }
    return replace(mechanism, links=found)


def _perturbed_inertia(body: Inertia, fraction: float, rng: np.random.Generator) -> Inertia:
    scale = np.maximum(1.0 + fraction * rng.normal(size=2), 0.1)
    R = rotation_rpy((fraction * rng.normal(size=3)).tolist())
    shift = fraction * 0.1 * rng.normal(size=3) if body.mass else np.zeros(3)
    # The inertia follows its mass, so that a body stays possible.
    inertia = scale[0] * scale[1] * R @ body.inertia @ R.T
    return Inertia(scale[0] * body.mass, body.com + shift, inertia)
