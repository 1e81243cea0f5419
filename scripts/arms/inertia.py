# SPDX-License-Identifier: Apache-2.0
"""Mass properties of a link: a uniform solid inside its shell with the link's stated mass."""

from dataclasses import dataclass

import numpy as np
import trimesh

from arms.sdf import Array


@dataclass(frozen=True)
class Body:
    """Mass [kg], centre of mass (3,) [m], inertia (3, 3) [kg m2] about it, density [kg/m3]."""

    mass: float
    com: Array
    inertia: Array
    density: float


def uniform_body(mesh: trimesh.Trimesh, mass: float) -> Body:
    """The closed `mesh` filled evenly so that it weighs `mass`.

    Sums over tetrahedra from a reference point inside; the second moment of a tetrahedron is
    V/20 (sum v v' + (sum v)(sum v)').
    """
    reference = mesh.bounds.mean(axis=0)
    corners = mesh.triangles - reference
    volumes = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) / 6
    volume = volumes.sum()
    total = corners.sum(axis=1)
    centre = (volumes[:, None] * total).sum(axis=0) / (4 * volume)
    squares = np.einsum("f,fci,fcj->ij", volumes, corners, corners)
    squares += np.einsum("f,fi,fj->ij", volumes, total, total)
    second = squares / 20 - volume * np.outer(centre, centre)
    density = mass / volume
    inertia = density * (np.trace(second) * np.eye(3) - second)
    return Body(mass, reference + centre, inertia, density)
