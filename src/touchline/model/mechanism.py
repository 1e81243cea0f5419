# SPDX-License-Identifier: Apache-2.0
"""The mechanism as its model file describes it: links, joints, inertias, geometry.

Both readers (`urdf.py`, `mjcf.py`) return a `Mechanism`; nothing here knows of sensors or of
what is observed.
"""

from dataclasses import dataclass, field

import numpy as np

from touchline.arrays import Array, Index


@dataclass(frozen=True)
class Inertia:
    """Mass properties of a rigid body: `mass` [kg], `com` (3,) [m] and `inertia` (3, 3) [kg m2].

    `com` and `inertia` are in link axes; `inertia` is about the centre of mass.
    """

    mass: float
    com: Array
    inertia: Array

    @staticmethod
    def zero() -> "Inertia":
        """A body without mass."""
        return Inertia(0.0, np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class Geometry:
    """One shape of a link's surface, at `T_link_shape` (4, 4) in the link frame.

    `kind` is "mesh" (`path`, `scale`) or "triangles" (`vertices`, `faces`), or one of these. "box":
    `size` = full edges. "cylinder": `size` = radius, length; axis z. "sphere": `size` = radius.
    "capsule": `size` = radius, length of the straight part; axis z. "ellipsoid": `size` = half
    axes.
    `problem` says why a mesh cannot be used; its `path` is None if it was not found. Where its file
    is not there, `missing_in` is the folder that should hold it.
    """

    kind: str
    T_link_shape: Array
    size: tuple[float, ...] = ()
    path: str | None = None
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    vertices: Array | None = None
    faces: Index | None = None
    problem: str | None = None
    missing_in: str | None = None


@dataclass(frozen=True)
class Link:
    """A rigid link with its own frame.

    `collision` is what carries contacts, `visual` what is drawn. `virtual` marks a link that is not
    in the model file but stands between two joints of one body.
    """

    name: str
    inertia: Inertia
    collision: tuple[Geometry, ...] = ()
    visual: tuple[Geometry, ...] = ()
    virtual: bool = False


@dataclass(frozen=True)
class Mimic:
    """This joint's position is `multiplier * q(joint) + offset`."""

    joint: str
    multiplier: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True)
class Joint:
    """A joint from link `parent` to link `child`.

    `T_parent_joint` (4, 4) places the child link's frame in the parent's at position 0; the child
    moves along or about `axis` (3,), a unit vector in the child's frame. `kind` is "revolute",
    "prismatic" or "fixed".
    """

    name: str
    kind: str
    parent: str
    child: str
    T_parent_joint: Array
    axis: Array = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    lower: float = -np.inf
    upper: float = np.inf
    velocity: float = np.inf
    effort: float = np.inf
    mimic: Mimic | None = None


@dataclass(frozen=True)
class Mechanism:
    """A tree of links. `links` and `joints` are in file order, `root` names the root link.

    `floating` is the link that a free joint carries in the file; it is taken to stand on the world.
    """

    name: str
    root: str
    links: dict[str, Link]
    joints: dict[str, Joint]
    gravity: Array
    warnings: tuple[str, ...] = ()
    floating: str | None = None
