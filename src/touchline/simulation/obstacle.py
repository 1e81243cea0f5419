# SPDX-License-Identifier: Apache-2.0
"""A compliant body that the simulated robot runs into: a pad on a spring on a mass on a rail.

The pad is light and collides; behind it the spring and the mass are free to choose, and a mass of
infinity is a wall. MuJoCo's own contact force is the truth.
"""

from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from touchline.model.transforms import rotation_to_axis
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

NAME = "obstacle"
PAD_MASS, PAD_RADIUS = 0.1, 0.03  # kg, m
PAD_STIFFNESS = 1e5  # N/m between pad and robot
PAD_DAMPING = 0.3  # ratio of that contact, which else would chatter
TOUCHES = 2  # links that the pad touches at once, where two of them meet
SPRING_DAMPING = 0.1  # ratio of the spring with the mass, or with 5 kg before a wall
WALL = 1e6  # kg


@dataclass(frozen=True)
class Body:
    """What stands in the way.

    Attributes:
        point: (3,) where its surface meets the robot's [m].
        direction: (3,) unit vector in which it is struck from its own side: towards the robot.
        time: at which its surface is at the point, if nothing stops it [s].
        speed: towards the robot [m/s].
        spring: [N/m].
        mass: behind the spring [kg]; inf: a wall.
        friction: coefficient between pad and robot.
    """

    point: ArrayLike
    direction: ArrayLike
    time: float = 0.0
    speed: float = 0.0
    spring: float = 2.5e4
    mass: float = 4.0
    friction: float = 0.3


class Obstacle:
    """One obstacle in a plant's model; its slots: the strongest links that it touches.

    Add it to the model first, `place` it after `Plant.reset`.
    """

    physical = True

    def __init__(self) -> None:
        self._mj: Any = import_module("mujoco")
        self._idle = [no_touch("")] * TOUCHES

    def __len__(self) -> int:
        return TOUCHES

    def add(self, spec: Any, bodies: dict[str, Any]) -> None:
        """Adds it to a model before it is compiled; see `build_model`."""
        firm_friction(spec)
        slide = {"type": self._mj.mjtJoint.mjJNT_SLIDE, "axis": [1.0, 0.0, 0.0]}
        mass = spec.worldbody.add_body(name=NAME, gravcomp=1.0, pos=[0.0, 0.0, 100.0])
        mass.explicitinertial, mass.mass, mass.inertia = True, 1.0, np.full(3, 1e-3)
        mass.add_joint(name=NAME, **slide)
        pad = mass.add_body(name=f"{NAME}:pad", gravcomp=1.0)
        pad.add_joint(name=f"{NAME}:pad", **slide)
        spring = contact_spring(PAD_STIFFNESS, PAD_MASS, PAD_DAMPING)
        add_ball(pad, NAME, PAD_RADIUS, PAD_MASS, spring)

    def place(self, plant: Plant, body: Body) -> None:
        """Puts it on its way; to be called after each `Plant.reset`."""
        m, d = plant.model, plant.data
        mass = min(body.mass, WALL)
        b, pad = m.body(NAME).id, m.joint(f"{NAME}:pad")
        m.body_mass[b] = mass
        m.jnt_stiffness[pad.id] = body.spring
        m.dof_damping[pad.dofadr[0]] = 2 * SPRING_DAMPING * np.sqrt(body.spring * min(mass, 5.0))
        m.geom_friction[m.geom(NAME).id, 0] = body.friction
        direction = np.asarray(body.direction, float)
        m.body_pos[b] = np.asarray(body.point, float) - PAD_RADIUS * direction
        along = rotation_to_axis(direction)[:, [2, 0, 1]]  # the rail is the x axis
        m.body_quat[b] = quaternion(along)
        state = d.qpos.copy(), d.qvel.copy(), d.time
        self._mj.mj_setConst(m, d)
        d.qpos[:], d.qvel[:], d.time = state
        rail = m.joint(NAME).dofadr[0]
        d.qpos[rail] = body.speed * (d.time - body.time)
        d.qvel[rail] = body.speed
        self._pressing = Pressing(plant, [NAME])

    def apply(self, plant: Plant) -> bool:
        """Nothing drives it."""
        return True

    def touches(self, plant: Plant) -> list[Touch]:
        """The contact forces on the robot at the plant's present state and inputs."""
        if plant.data.ncon == 0:
            return self._idle
        (found,) = self._pressing.touches()
        return (sorted(found.values(), key=strength, reverse=True) + self._idle)[:TOUCHES]
