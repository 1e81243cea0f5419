# SPDX-License-Identifier: Apache-2.0
"""Balls that are pushed against the simulated robot; MuJoCo's own contact forces are the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.arrays import Array
from touchline.simulation.contacts import Touch, no_touch
from touchline.simulation.mujoco_model import quaternion
from touchline.simulation.plant import Plant
from touchline.simulation.pressing import (
    Pressing,
    add_ball,
    contact_spring,
    firm_friction,
    strength,
)

CONTACT_DAMPING = 0.05  # ratio; the rail damps too, and more would make touching down a jump


@dataclass(frozen=True)
class Pusher:
    """A ball on a rail, drawn along it by a spring whose far end travels in and back.

    Attributes:
        name: of the ball.
        link: that it is meant to touch; what else it touches is told in a slot of its own.
        point: (3,) in world towards which its surface travels [m].
        direction: (3,) in which it pushes, world.
        start: when it sets out, `gap` away from the point [s].
        hold: how long it pushes with full force [s].
        force: of the spring when it is held there [N].
        radius: of the ball [m].
        gap: [m].
        speed: of the spring's end [m/s].
        stiffness: of the spring [N/m].
        mass: of the ball [kg].
        friction: coefficient between ball and robot.
        contact_stiffness: between ball and robot [N/m]: 20 N press them 1 mm into each other.
    """

    name: str
    link: str
    point: ArrayLike
    direction: ArrayLike
    start: float
    hold: float = 1.0
    force: float = 20.0
    radius: float = 0.025
    gap: float = 0.004
    speed: float = 0.02
    stiffness: float = 2000.0
    mass: float = 0.2
    friction: float = 0.5
    contact_stiffness: float = 2e4

    @property
    def duration(self) -> float:
        """From setting out until it is back [s]."""
        return 2 * self._reach / self.speed + self.hold

    @property
    def _reach(self) -> float:
        return self.gap + self.force / self.stiffness

    def travel(self, time: float) -> float:
        """How far the spring's end has come [m]."""
        way = self.speed * (time - self.start)
        back = self.speed * (self.start + self.duration - time)
        return float(np.clip(min(way, back), 0.0, self._reach))


class CollidingPushers:
    """Balls in the plant's model; two slots each: the link that is meant, and the strongest other.

    Args:
        pushers: whose names differ.
    """

    physical = True

    def __init__(self, pushers: Sequence[Pusher]) -> None:
        self._mj: Any = import_module("mujoco")
        self.pushers = tuple(pushers)
        self._idle = [no_touch(pusher.link) for pusher in self.pushers for _ in range(2)]
        self._pressing: Pressing | None = None  # found once there is a plant

    def __len__(self) -> int:
        return 2 * len(self.pushers)

    def add(self, spec: Any, bodies: dict[str, Any]) -> None:
        """Adds the balls to a model before it is compiled; see `build_model`."""
        firm_friction(spec)
        for pusher in self.pushers:
            direction = _unit(pusher.direction)
            away = pusher.radius + pusher.gap
            body = spec.worldbody.add_body(
                name=f"pusher:{pusher.name}",
                pos=np.asarray(pusher.point, float) - away * direction,
                gravcomp=1.0,
            )
            body.add_joint(
                name=f"pusher:{pusher.name}",
                type=self._mj.mjtJoint.mjJNT_SLIDE,
                axis=direction,
                damping=2.0 * np.sqrt(pusher.stiffness * pusher.mass),
            )
            add_ball(
                body,
                f"pusher:{pusher.name}",
                pusher.radius,
                pusher.mass,
                contact_spring(pusher.contact_stiffness, pusher.mass, CONTACT_DAMPING),
                quat=quaternion(np.eye(3)),
                friction=[pusher.friction, 0.005, 0.0001],
            )

    def apply(self, plant: Plant) -> bool:
        """Draws the balls along; to be called after `evaluate`."""
        if self._pressing is None:
            names = [f"pusher:{pusher.name}" for pusher in self.pushers]
            self._dofs = [int(plant.model.joint(name).dofadr[0]) for name in names]
            self._pressing = Pressing(plant, names)
        for pusher, dof in zip(self.pushers, self._dofs, strict=True):
            stretch = pusher.travel(plant.time) - plant.data.qpos[dof]
            plant.data.qfrc_applied[dof] = pusher.stiffness * stretch
        return True

    def touches(self, plant: Plant) -> list[Touch]:
        """The contact forces on the robot at the plant's present state and inputs."""
        if plant.data.ncon == 0 or self._pressing is None:
            return self._idle
        touches = list(self._idle)
        for i, by_link in enumerate(self._pressing.touches()):
            touches[2 * i] = by_link.pop(self.pushers[i].link, touches[2 * i])
            touches[2 * i + 1] = max(by_link.values(), key=strength, default=touches[2 * i + 1])
        return touches


def _unit(vector: ArrayLike) -> Array:
    v = np.asarray(vector, float)
    return v / np.linalg.norm(v)
