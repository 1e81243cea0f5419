# SPDX-License-Identifier: Apache-2.0
"""Scripted forces on the simulated robot: where, how strong, when."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.simulation.plant import Plant

SHAPES = ("step", "ramp", "smooth", "half_sine")


@dataclass(frozen=True)
class Profile:
    """How a contact's strength, 0 to 1, runs over time.

    It rises within `rise`, is held for `hold`, and falls within `fall` [s]. `shape`: "step" has
    neither rise nor fall, "ramp" is linear, "smooth" a half cosine, "half_sine" one arch over the
    whole duration.

    Raises:
        ValueError: unknown shape or a negative time.
    """

    start: float
    hold: float = np.inf
    rise: float = 0.05
    fall: float = 0.05
    shape: str = "smooth"

    def __post_init__(self) -> None:
        if self.shape not in SHAPES:
            raise ValueError(f"shape is '{self.shape}', allowed: {', '.join(SHAPES)}")
        if min(self.hold, self.rise, self.fall) < 0:
            raise ValueError("hold, rise and fall of a profile must not be negative")

    @property
    def end(self) -> float:
        """When it is over [s]."""
        flanks = 0.0 if self.shape == "step" else self.rise + self.fall
        return self.start + self.hold + flanks

    def at(self, time: float) -> float:
        """The strength, 0 to 1, at a time [s]."""
        if not self.start <= time < self.end:
            return 0.0
        if self.shape == "step":
            return 1.0
        if self.shape == "half_sine":
            return float(np.sin(np.pi * (time - self.start) / (self.end - self.start)))
        up = (time - self.start) / self.rise if self.rise else 1.0
        down = (self.end - time) / self.fall if self.fall else 1.0
        x = min(up, down, 1.0)
        return x if self.shape == "ramp" else 0.5 - 0.5 * float(np.cos(np.pi * x))


@dataclass(frozen=True)
class ScriptedContact:
    """A force, and if wanted a moment, on a link.

    Attributes:
        link: that is touched.
        point: (3,) where [m], in link axes or in world.
        force: (3,) on the robot [N], in link axes or in world.
        profile: strength over time.
        moment: (3,) [Nm] about the point, in the axes of the force.
        point_frame: "link": the point is carried along; "world": the link slides beneath it.
        force_frame: "world": the direction stays; "link": it turns with the link.

    Raises:
        ValueError: an unknown frame.
    """

    link: str
    point: ArrayLike
    force: ArrayLike
    profile: Profile
    moment: ArrayLike = (0.0, 0.0, 0.0)
    point_frame: str = "link"
    force_frame: str = "world"

    def __post_init__(self) -> None:
        for frame in (self.point_frame, self.force_frame):
            if frame not in ("link", "world"):
                raise ValueError(f"frame is '{frame}', allowed: link, world")
        for name in ("point", "force", "moment"):
            object.__setattr__(self, name, np.array(getattr(self, name), float).reshape(3))

    def vectors(self) -> tuple[Array, Array, Array]:
        """Point, force and moment, (3,) each, in their own frames."""
        return np.asarray(self.point), np.asarray(self.force), np.asarray(self.moment)


@dataclass(frozen=True)
class Touch:
    """One contact at one instant.

    Attributes:
        active: whether there is contact.
        link: touched.
        point: (3,) in world [m].
        force: (3,) on the robot, world axes [N].
        moment: (3,) about the point, world axes [Nm].
    """

    active: bool
    link: str
    point: Array
    force: Array
    moment: Array

    def wrench(self) -> Array:
        """The wrench (6,) about the world's origin, world axes [N, Nm]."""
        out = np.empty(6)
        out[:3], out[3:] = self.force, cross(self.point, self.force) + self.moment
        return out


NOTHING = np.zeros(3)
NOTHING.setflags(write=False)


def no_touch(link: str) -> Touch:
    """A slot in which nothing touches."""
    return Touch(False, link, NOTHING, NOTHING, NOTHING)


class Forces:
    """Applies forces to a plant, each held over a step.

    Args:
        idle: what each slot tells while nothing acts in it.
    """

    physical = False

    def __init__(self, idle: Sequence[Touch]) -> None:
        self._idle = list(idle)
        self._touches = self._idle
        self._arms: dict[int, Array] = {}  # of active slots, from the centre of mass

    def __len__(self) -> int:
        return len(self._idle)

    def acting(self, slot: int, plant: Plant) -> Touch | None:
        """What is to act in a slot from the plant's present time on."""
        raise NotImplementedError

    def apply(self, plant: Plant) -> bool:
        """Sets the forces of the plant's present time; to be called after `evaluate`."""
        acted = bool(self._arms)
        for slot in self._arms:
            plant.data.xfrc_applied[plant.bodies[self._touches[slot].link]] = 0.0
        self._arms = {}
        self._touches = list(self._idle)
        for slot in range(len(self)):
            touch = self.acting(slot, plant)
            if touch is not None:
                self._touches[slot] = touch
                self._arms[slot] = _push(plant, touch)
        return acted or bool(self._arms)

    def touches(self, plant: Plant) -> list[Touch]:
        """The forces that act now, be it just after `apply` or at the end of the step.

        MuJoCo holds force and moment about the centre of mass over a step, so until the next
        `apply` the point moves with that centre without turning about it.
        """
        if not self._arms:
            return self._idle
        now = list(self._idle)
        for slot, arm in self._arms.items():
            touch = self._touches[slot]
            point = plant.data.xipos[plant.bodies[touch.link]] + arm
            now[slot] = Touch(True, touch.link, point, touch.force, touch.moment)
        return now


class ScriptedForces(Forces):
    """Applies scripted contacts to a plant."""

    def __init__(self, contacts: Sequence[ScriptedContact]) -> None:
        self.contacts = tuple(contacts)
        self._spans = [(contact.profile.start, contact.profile.end) for contact in self.contacts]
        super().__init__([no_touch(contact.link) for contact in self.contacts])

    def apply(self, plant: Plant) -> bool:
        """Sets the forces of the plant's present time; to be called after `evaluate`."""
        time = plant.time
        if not self._arms and not any(start <= time < end for start, end in self._spans):
            return False  # as most of the time
        return super().apply(plant)

    def acting(self, slot: int, plant: Plant) -> Touch | None:
        """The contact of a slot while its profile is not over."""
        time, (start, end) = plant.time, self._spans[slot]
        if not start <= time < end:
            return None
        strength = self.contacts[slot].profile.at(time)
        return _touch(self.contacts[slot], strength, plant) if strength > 0.0 else None


def _push(plant: Plant, touch: Touch) -> Array:
    """Adds a force to a body; returns its point (3,) from the centre of mass [m]."""
    body = plant.bodies[touch.link]
    arm = touch.point - plant.data.xipos[body]
    applied = plant.data.xfrc_applied[body]
    applied[:3] += touch.force
    applied[3:] += cross(arm, touch.force) + touch.moment
    return arm


def cross(a: Array, b: Array) -> Array:
    """The cross product of two (3,); numpy's own is much slower for one pair."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return np.array([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _touch(contact: ScriptedContact, strength: float, plant: Plant) -> Touch:
    body = plant.bodies[contact.link]
    R = plant.data.xmat[body].reshape(3, 3)
    point, force, moment = contact.vectors()
    force, moment = strength * force, strength * moment
    if contact.point_frame == "link":
        point = plant.data.xpos[body] + R @ point
    if contact.force_frame == "link":
        force, moment = R @ force, R @ moment
    return Touch(True, contact.link, point, force, moment)
