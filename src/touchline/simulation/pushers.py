# SPDX-License-Identifier: Apache-2.0
"""Balls that are pushed against the simulated robot; MuJoCo's own contact forces are the truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from touchline.simulation.contacts import NOTHING, Touch, cross, no_touch
from touchline.simulation.mujoco_model import quaternion
from touchline.simulation.plant import Plant
from touchline.simulation.shapes import OTHER, ROBOT

Array = NDArray[np.float64]
Force = tuple[Array, Array]  # point and force, (3,) each


# MuJoCo's contact force is (impedance * the other forces on the ball) + spring + damper. At its
# default impedance a contact begins and ends with a jump by nearly all of these other forces; at a
# small one it is a plain spring. `impratio` keeps friction firm all the same.
IMPEDANCE = 0.02
FRICTION_RATIO = 50.0
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
        self._owners: tuple[str, ...] = ()
        self._idle = [no_touch(pusher.link) for pusher in self.pushers for _ in range(2)]
        self._wrench = np.zeros(6)

    def __len__(self) -> int:
        return 2 * len(self.pushers)

    def add(self, spec: Any, bodies: dict[str, Any]) -> None:
        """Adds the balls to a model before it is compiled; see `build_model`."""
        spec.option.impratio = FRICTION_RATIO
        spec.option.cone = self._mj.mjtCone.mjCONE_ELLIPTIC
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
            body.add_geom(
                name=f"pusher:{pusher.name}",
                type=self._mj.mjtGeom.mjGEOM_SPHERE,
                size=[pusher.radius, 0, 0],
                quat=quaternion(np.eye(3)),
                mass=pusher.mass,
                contype=OTHER,
                conaffinity=ROBOT,
                condim=3,
                priority=1,
                friction=[pusher.friction, 0.005, 0.0001],
                solref=_contact_spring(pusher),
                solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
            )

    def apply(self, plant: Plant) -> bool:
        """Draws the balls along; to be called after `evaluate`."""
        if not self._owners:
            self._find(plant)
        for pusher, dof in zip(self.pushers, self._dofs, strict=True):
            stretch = pusher.travel(plant.time) - plant.data.qpos[dof]
            plant.data.qfrc_applied[dof] = pusher.stiffness * stretch
        return True

    def _find(self, plant: Plant) -> None:
        model = plant.model
        links = {body: link for link, body in plant.bodies.items()}
        self._owners = tuple(links.get(int(body), "") for body in model.geom_bodyid)
        names = [f"pusher:{pusher.name}" for pusher in self.pushers]
        self._dofs = [int(model.joint(name).dofadr[0]) for name in names]
        self._geoms = {int(model.geom(name).id): i for i, name in enumerate(names)}

    def touches(self, plant: Plant) -> list[Touch]:
        """The contact forces on the robot at the plant's present state and inputs."""
        if plant.data.ncon == 0:
            return self._idle
        touches = list(self._idle)
        for i, by_link in self._sorted(plant).items():
            joined = {link: _joined(link, forces) for link, forces in by_link.items()}
            touches[2 * i] = joined.pop(self.pushers[i].link, touches[2 * i])
            touches[2 * i + 1] = max(joined.values(), key=_strength, default=touches[2 * i + 1])
        return touches

    def _sorted(self, plant: Plant) -> dict[int, dict[str, list[Force]]]:
        """Points and forces on the robot by ball and link."""
        contacts, found = plant.data.contact, {}
        pairs, points = contacts.geom.tolist(), contacts.pos
        for c, (first, second) in enumerate(pairs):
            sign = 1.0 if first in self._geoms else -1.0
            ball, other = (first, second) if first in self._geoms else (second, first)
            if ball not in self._geoms:
                continue
            self._mj.mj_contactForce(plant.model, plant.data, c, self._wrench)
            if self._wrench[0] > 0.0:
                # MuJoCo gives the force of the first shape on the second, in the contact's axes.
                force = sign * (self._wrench[:3] @ contacts.frame[c].reshape(3, 3))
                links = found.setdefault(self._geoms[ball], {})
                links.setdefault(self._owners[other], []).append((points[c].copy(), force))
        return found


def _contact_spring(pusher: Pusher) -> list[float]:
    """MuJoCo's `solref` of a spring between the ball and something much heavier."""
    k = pusher.contact_stiffness / pusher.mass
    return [-k, -2 * CONTACT_DAMPING * np.sqrt(k)]


def _strength(touch: Touch) -> float:
    return float(touch.force @ touch.force)


def _joined(link: str, forces: list[Force]) -> Touch:
    """Contacts of one ball with one link as one: at their centre, with the moment that is left."""
    if len(forces) == 1:
        return Touch(True, link, *forces[0], NOTHING)
    weights = np.array([np.linalg.norm(force) for _, force in forces])
    point = weights @ np.array([at for at, _ in forces]) / weights.sum()
    moment = np.sum([cross(at - point, force) for at, force in forces], axis=0)
    return Touch(True, link, point, np.sum([force for _, force in forces], axis=0), moment)


def _unit(vector: ArrayLike) -> Array:
    v = np.asarray(vector, float)
    return v / np.linalg.norm(v)
