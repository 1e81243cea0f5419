# SPDX-License-Identifier: Apache-2.0
"""Where and in which direction a robot that stands or moves can be pushed for a while."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.simulation.control import Trajectory
from touchline.simulation.touchable import CLEARANCE, SurfacePoint, TouchableSurface

FRICTION = 0.4  # a scripted force stays within this cone while it acts
INSTANTS = 7  # at which that is verified
TRIES = 20_000
SINGULAR_TRIES = 3000


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

    def poses(self, time: float) -> dict[str, Array]:
        """Poses (4, 4) of the links where the trajectory is at a time [s]."""
        return self._robot.T_world_links(self._trajectory(time).q)

    def find(
        self,
        links: Sequence[str],
        start: float,
        end: float,
        clearance: float = CLEARANCE,
    ) -> Place:
        """A place that can be pushed from `start` to `end` [s] with one force constant in world.

        Args:
            links: one of which is touched.
            start: of the push.
            end: of the push.
            clearance: free along the outward normal, half way through the push [m].

        Raises:
            InputError: there is no such place.
        """
        times = np.linspace(start, end, INSTANTS if end > start else 1)
        poses = [self.poses(t) for t in times]
        self._surface.place(poses[len(poses) // 2])
        for _ in range(TRIES):
            at = self._surface.draw(self.rng, links)
            push = _push([T[at.link] for T in poses], at)
            if push is not None and self._free(poses[len(poses) // 2][at.link], at, clearance):
                return Place(at, push)
        raise InputError(
            f"robot {self._robot.name}: no place on {', '.join(links)} can be pushed "
            f"from {start:g} s to {end:g} s"
        )

    def find_weakest(self, links: Sequence[str]) -> tuple[Place, float]:
        """The place, of many, where a push in the friction cone loads the joints least.

        Args:
            links: one of which is touched, in the pose at time 0.

        Returns:
            The place, and the joint torques' norm per newton [Nm/N].

        Raises:
            InputError: no place was found.
        """
        q = self._trajectory(0.0).q
        poses, rates = self._robot.T_world_links(q), pose_rates(self._robot, q)
        self._surface.place(poses)
        best: tuple[Place, float] | None = None
        for _ in range(SINGULAR_TRIES):
            at = self._surface.draw(self.rng, links)
            direction, size = weakest_direction(rates[at.link], at.point)
            normal = poses[at.link][:3, :3] @ at.normal
            push = -np.sign(normal @ direction) * direction
            better = best is None or size < best[1]
            if (
                better
                and _in_cone(float(-normal @ push))
                and self._free(poses[at.link], at, CLEARANCE)
            ):
                best = Place(at, push), size
        if best is None:
            raise InputError(f"robot {self._robot.name}: no singular push on {', '.join(links)}")
        return best

    def _free(self, T: Array, at: SurfacePoint, clearance: float) -> bool:
        point, normal = T[:3, :3] @ at.point + T[:3, 3], T[:3, :3] @ at.normal
        return self._surface.reachable(point, normal, clearance)


def _push(poses: list[Array], at: SurfacePoint) -> Array | None:
    """A unit vector that stays within the friction cone all the time, if there is one."""
    normals = np.array([T[:3, :3] @ at.normal for T in poses])
    mean = normals.mean(axis=0)
    push = -mean / max(float(np.linalg.norm(mean)), 1e-9)
    return push if _in_cone(float(np.min(-normals @ push))) else None


def _in_cone(cosine: float) -> bool:
    return bool(cosine >= 1.0 / np.sqrt(1.0 + FRICTION**2))


def pose_rates(robot: Robot, q: Array) -> dict[str, Array]:
    """How each joint moves each link: derivatives (n, 4, 4) of its pose, by central differences.

    Args:
        robot: at `q`.
        q: joint positions (n,) [rad or m].
    """
    step = 1e-5 * np.eye(len(q))
    ends = [(robot.T_world_links(q + e), robot.T_world_links(q - e)) for e in step]
    return {
        link: np.array([(ahead[link] - behind[link]) / 2e-5 for ahead, behind in ends])
        for link in robot.mechanism.links
    }


def weakest_direction(rates: Array, point: Array) -> tuple[Array, float]:
    """The direction in which the joints move a point of a link least, and by how much.

    Args:
        rates: (n, 4, 4) of the link, from `pose_rates`.
        point: (3,) in the link's frame [m].

    Returns:
        A unit vector (3,) in world, and the singular value of the point's Jacobian that belongs
        to it: the norm of the joint torques of 1 N in that direction [Nm/N].
    """
    J = (rates @ np.append(point, 1.0))[:, :3].T
    directions, sizes, _ = np.linalg.svd(J)
    return directions[:, 2], float(sizes[2]) if len(sizes) == 3 else 0.0
