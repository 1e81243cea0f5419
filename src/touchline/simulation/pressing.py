# SPDX-License-Identifier: Apache-2.0
"""What presses the simulated robot: MuJoCo's own contact forces, and the shapes that make them.

MuJoCo's contact force is (impedance * the other forces on the shape) + spring + damper. At its
default impedance a contact begins and ends with a jump by nearly all of these other forces; at a
small one it is a plain spring. `impratio` keeps friction firm all the same.
"""

from collections.abc import Sequence
from importlib import import_module
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.simulation.contacts import NOTHING, Touch, cross
from touchline.simulation.plant import Plant
from touchline.simulation.shapes import OTHER, ROBOT

Force = tuple[Array, Array]  # point and force, (3,) each

IMPEDANCE = 0.02
FRICTION_RATIO = 50.0


def firm_friction(spec: Any) -> None:
    """Sets the options of a model in which something presses the robot."""
    spec.option.impratio = FRICTION_RATIO
    spec.option.cone = import_module("mujoco").mjtCone.mjCONE_ELLIPTIC


def add_ball(body: Any, name: str, radius: float, mass: float, solref: list[float], **more) -> None:
    """Adds a ball that touches the robot, and nothing else, to a body of a model.

    Args:
        body: of a MuJoCo specification.
        name: of the shape.
        radius: [m].
        mass: [kg].
        solref: of the contact, from `contact_spring`.
        more: attributes of the shape.
    """
    body.add_geom(
        name=name,
        type=import_module("mujoco").mjtGeom.mjGEOM_SPHERE,
        size=[radius, 0, 0],
        mass=mass,
        contype=OTHER,
        conaffinity=ROBOT,
        condim=3,
        priority=1,
        solref=solref,
        solimp=[IMPEDANCE, IMPEDANCE, 0.001, 0.5, 2.0],
        **more,
    )


def contact_spring(stiffness: float, mass: float, ratio: float) -> list[float]:
    """MuJoCo's `solref` of a spring [N/m] between a mass [kg] and something much heavier.

    `ratio` is that of the damping to the critical one.
    """
    k = stiffness / mass
    return [-k, -2 * ratio * np.sqrt(k)]


class Pressing:
    """The contact forces of some shapes on the robot.

    Args:
        plant: in whose model the shapes are.
        shapes: their names.
    """

    def __init__(self, plant: Plant, shapes: Sequence[str]) -> None:
        self._mj: Any = import_module("mujoco")
        self._plant, self._wrench = plant, np.zeros(6)
        links = {body: link for link, body in plant.bodies.items()}
        self._owners = tuple(links.get(int(body), "") for body in plant.model.geom_bodyid)
        self._shapes = {int(plant.model.geom(name).id): i for i, name in enumerate(shapes)}

    def touches(self) -> list[dict[str, Touch]]:
        """For each shape what it does to which link, at the plant's present state and inputs."""
        forces: list[dict[str, list[Force]]] = [{} for _ in self._shapes]
        contacts = self._plant.data.contact
        pairs, points = contacts.geom.tolist(), contacts.pos
        for c, (first, second) in enumerate(pairs):
            sign = 1.0 if first in self._shapes else -1.0
            shape, other = (first, second) if first in self._shapes else (second, first)
            if shape not in self._shapes:
                continue
            self._mj.mj_contactForce(self._plant.model, self._plant.data, c, self._wrench)
            if self._wrench[0] > 0.0:
                # MuJoCo gives the force of the first shape on the second, in the contact's axes.
                force = sign * (self._wrench[:3] @ contacts.frame[c].reshape(3, 3))
                links = forces[self._shapes[shape]]
                links.setdefault(self._owners[other], []).append((points[c].copy(), force))
        return [{link: _joined(link, own) for link, own in links.items()} for links in forces]


def strength(touch: Touch) -> float:
    """By which touches are compared: the square of the force [N2]."""
    return float(touch.force @ touch.force)


def _joined(link: str, forces: list[Force]) -> Touch:
    """Contacts of one shape with one link as one: at their centre, with the moment that is left."""
    if len(forces) == 1:
        return Touch(True, link, *forces[0], NOTHING)
    weights = np.array([np.linalg.norm(force) for _, force in forces])
    point = weights @ np.array([at for at, _ in forces]) / weights.sum()
    moment = np.sum([cross(at - point, force) for at, force in forces], axis=0)
    return Touch(True, link, point, np.sum([force for _, force in forces], axis=0), moment)
