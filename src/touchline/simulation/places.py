# SPDX-License-Identifier: Apache-2.0
"""Where and in which direction a robot that stands or moves can be pushed for a while."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.simulation.control import Trajectory
from touchline.simulation.touchable import CLEARANCE, SurfacePoint, TouchableSurface

Array = NDArray[np.float64]
FRICTION = 0.4  # a scripted force stays within this cone while it acts
INSTANTS = 7  # at which that is verified
TRIES = 20_000


@dataclass(frozen=True)
class Place:
    """A point of the surface, and a unit vector (3,) in world that pushes into it."""

    at: SurfacePoint
    direction: Array

    @property
    def link(self) -> str:
        """That is touched."""
        return self.at.link


class PlaceFinder:
    """Draws places for pushes along a trajectory; the same `rng` gives the same ones.

    Args:
        robot: that is pushed.
        trajectory: that it follows.
        rng: draws.
    """

    def __init__(self, robot: Robot, trajectory: Trajectory, rng: np.random.Generator) -> None:
        self._robot, self._trajectory, self.rng = robot, trajectory, rng
        self._surface = TouchableSurface(robot)

    def find(
        self,
        links: Sequence[str],
        start: float,
        end: float,
        clearance: float = CLEARANCE,
        direction: Array | None = None,
    ) -> Place:
        """A place that can be pushed from `start` to `end` [s] with one force constant in world.

        Args:
            links: one of which is touched.
            start: of the push.
            end: of the push.
            clearance: free along the outward normal, half way through the push [m].
            direction: (3,) of the force up to its sign; default: against the normal, on average.

        Raises:
            InputError: there is no such place.
        """
        times = np.linspace(start, end, INSTANTS if end > start else 1)
        poses = [self._robot.T_world_links(self._trajectory(t).q) for t in times]
        self._surface.place(poses[len(poses) // 2])
        for _ in range(TRIES):
            at = self._surface.draw(self.rng, links)
            push = _push([T[at.link] for T in poses], at, direction)
            if push is not None and self._free(poses[len(poses) // 2][at.link], at, clearance):
                return Place(at, push)
        raise InputError(
            f"robot {self._robot.name}: no place on {', '.join(links)} can be pushed "
            f"from {start:g} s to {end:g} s"
        )

    def _free(self, T: Array, at: SurfacePoint, clearance: float) -> bool:
        point, normal = T[:3, :3] @ at.point + T[:3, 3], T[:3, :3] @ at.normal
        return self._surface.reachable(point, normal, clearance)


def _push(poses: list[Array], at: SurfacePoint, direction: Array | None) -> Array | None:
    """A unit vector that stays within the friction cone all the time, if there is one."""
    normals = np.array([T[:3, :3] @ at.normal for T in poses])
    mean = normals.mean(axis=0)
    if direction is None:
        push = -mean / max(float(np.linalg.norm(mean)), 1e-9)
    else:
        push = -np.sign(mean @ direction) * direction / np.linalg.norm(direction)
    inside = -normals @ push >= 1.0 / np.sqrt(1.0 + FRICTION**2)
    return push if inside.all() else None


def weakest_direction(robot: Robot, link: str, point: Array, q: Array) -> tuple[Array, float]:
    """The direction in which the joints move a point least, and how much less than the most.

    Args:
        robot: at `q`.
        link: that carries the point.
        point: (3,) in the link's frame [m].
        q: joint positions (n,) [rad or m].

    Returns:
        A unit vector (3,) in world, and the ratio of the least to the largest singular value of
        the point's Jacobian.
    """
    J = np.empty((3, len(q)))
    for j in range(len(q)):
        ends = []
        for step in (-1e-5, 1e-5):
            moved = np.array(q, float)
            moved[j] += step
            T = robot.T_world_links(moved)[link]
            ends.append(T[:3, :3] @ point + T[:3, 3])
        J[:, j] = (ends[1] - ends[0]) / 2e-5
    directions, sizes, _ = np.linalg.svd(J)
    return directions[:, 2], float(sizes[-1] / sizes[0]) if len(sizes) == 3 else 0.0
