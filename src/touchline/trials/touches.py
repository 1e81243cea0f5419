# SPDX-License-Identifier: Apache-2.0
"""Random touches of an arm at rest, and what its sensors report: no physics engine needed."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import islice

import numpy as np

from touchline.arrays import Array, Mask
from touchline.localizer.skin import Patch, Skin
from touchline.model.robot import Robot
from touchline.model.transforms import rotation_to_axis
from touchline.observer.dynamics import gravity_loads

TRIES = 200  # places on a segment, before another pose is tried


@dataclass(frozen=True)
class Touch:
    """A force on an arm at rest.

    Attributes:
        q: joint positions (n,) [rad or m].
        patch: the surface that is touched.
        position: (3,) [m] in world.
        normal: (3,) outward, in world.
        force: (3,) [N] on the robot, in world.
    """

    q: Array
    patch: Patch
    position: Array
    normal: Array
    force: Array


class TouchSampler:
    """Random poses and reachable points, uniform over the area of the surfaces.

    Args:
        skin: the robot's surfaces.
        rng: source of chance.
        segments: only links of these segments; default: all that are felt.
        friction: forces are uniform in this friction cone.
        clearance: free space along the outward normal and along the way the push comes [m].
        floor: points lie above this height [m].
        links: only these; default: all.
    """

    def __init__(
        self,
        skin: Skin,
        rng: np.random.Generator,
        segments: tuple[str, ...] | None = None,
        friction: float = 0.5,
        clearance: float = 0.03,
        floor: float = 0.0,
        links: Sequence[str] | None = None,
    ) -> None:
        self.skin, self.robot, self._rng = skin, skin.robot, rng
        self._friction, self._clearance, self._floor = friction, clearance, floor
        self._patches = [
            patch
            for patch in skin.patches
            if patch.segment is not None
            and (segments is None or patch.segment in segments)
            and (links is None or patch.link in links)
        ]
        areas = np.array([patch.surface.areas.sum() for patch in self._patches])
        self._shares = areas / areas.sum()

    def sample(self, force: float, q: Array | None = None, taken: tuple[str, ...] = ()) -> Touch:
        """A reachable touch of `force` [N], at joint positions `q` (n,) or at random ones.

        Args:
            force: [N].
            q: joint positions (n,) [rad or m].
            taken: rigid bodies that are not to be touched.
        """
        while True:
            touch = self.attempt(force, self.pose() if q is None else q, taken)
            if touch is not None:
                return touch

    def pose(self) -> Array:
        """Random joint positions (n,) [rad or m] within their limits."""
        return self._rng.uniform(*self.robot.ranges)

    def attempt(self, force: float, q: Array, taken: tuple[str, ...] = ()) -> Touch | None:
        """A random touch, as of `sample`; None if that place is taken or cannot be reached."""
        patch = self._patches[self._rng.choice(len(self._patches), p=self._shares)]
        if patch.body in taken:
            return None
        point, normal = self._point(patch, q)
        if not self.reachable(q, point, normal):
            return None
        way = _in_cone(-normal, self._friction, self._rng)
        return Touch(q, patch, point, normal, force * way) if self._free(q, point, -way) else None

    def sample_several(self, count: int, force: float) -> list[Touch]:
        """Reachable touches of an arm in one random pose, at most one per rigid body."""
        touches = [self.sample(force)]
        while len(touches) < count:
            taken = tuple(touch.patch.body for touch in touches)
            touches.append(self.sample(force, touches[0].q, taken))
        return touches

    def _point(self, patch: Patch, q: Array) -> tuple[Array, Array]:
        surface = patch.surface
        face = self._rng.choice(len(surface.faces), p=surface.areas / surface.areas.sum())
        u, v = self._rng.random(2)
        if u + v > 1:
            u, v = 1 - u, 1 - v
        a, b, c = surface.vertices[surface.faces[face]]
        T = self.robot.poses(q)[patch.node] @ patch.T_node_link
        local = a + u * (b - a) + v * (c - a)
        return T[:3, :3] @ local + T[:3, 3], T[:3, :3] @ surface.normals[face]

    def reachable(self, q: Array, point: Array, normal: Array) -> bool:
        """Does a finger get to a point (3,) [m] of the surface from outside, in posture `q`?"""
        if point[2] < self._floor or self.skin.links_around(q, point + 1e-6 * normal):
            return False
        return self._free(q, point, normal)

    def _free(self, q: Array, point: Array, direction: Array) -> bool:
        crossings = self.skin.crossings(q, point, direction)
        return all(not 1e-6 < c.distance < self._clearance for c in crossings)


def sample_on_each(
    segments: tuple[str, ...],
    skin: Skin,
    rng: np.random.Generator,
    force: float,
    friction: float = 0.5,
) -> list[Touch]:
    """Reachable touches of an arm in one random pose in which all these segments can be reached.

    Args:
        segments: one touch on each, in this order.
        skin: the robot's surfaces.
        rng: source of chance.
        force: [N].
        friction: forces are uniform in this friction cone.
    """
    samplers = [TouchSampler(skin, rng, (name,), friction) for name in segments]
    while True:
        q, touches = samplers[0].pose(), []
        for sampler in samplers:
            tries = (sampler.attempt(force, q) for _ in range(TRIES))
            touches += islice((touch for touch in tries if touch is not None), 1)
        if len(touches) == len(samplers):
            return touches


def _in_cone(axis: Array, friction: float, rng: np.random.Generator) -> Array:
    """A unit vector uniform over the solid angle of a cone around `axis`."""
    cosine = rng.uniform(1.0 / np.sqrt(1.0 + friction**2), 1.0)
    turn = rng.uniform(0.0, 2 * np.pi)
    side = rotation_to_axis(axis)[:, :2] @ np.array([np.cos(turn), np.sin(turn)])
    return cosine * axis - np.sqrt(1.0 - cosine**2) * side


@dataclass(frozen=True)
class Signals:
    """What the sensors of an arm at rest report: `time` (N,), `q`, `qd`, `tau`, `wrench`."""

    time: Array
    q: Array
    qd: Array
    tau: Array
    wrench: Array


def resting_signals(
    robot: Robot,
    q: Array,
    touches: list[tuple[Touch, float]],
    duration: float,
    rng: np.random.Generator | None,
    period: float = 1e-3,
) -> Signals:
    """What the sensors report while an arm at rest is touched.

    Sensors are taken as plain: sign 1, no bias, polarity outboard, their own axes.

    Args:
        robot: the robot.
        q: joint positions (n,) [rad or m].
        touches: each with the time at which it begins [s]; it lasts to the end.
        duration: of the recording [s].
        rng: source of the noise of the description; None: without noise.
        period: between samples [s].
    """
    n, k = len(robot.joint_names), len(robot.sensor_names)
    time = np.arange(round(duration / period), dtype=np.float64) * np.float64(period)
    weight = gravity_loads(robot, q)
    rest = np.concatenate([weight.torque, weight.wrench.ravel()])
    loads = np.zeros((len(time), n + 6 * k))
    for touch, begin in touches:
        loads[time >= begin] += touch_loads(robot, q, touch.patch.node, touch.position, touch.force)
    signals = rest - loads  # at rest: 0 = tau - n + tau_ext
    still = np.zeros((len(time), n))
    exact = Signals(
        time,
        np.tile(q, (len(time), 1)),
        still,
        signals[:, :n],
        signals[:, n:].reshape(len(time), k, 6),
    )
    return add_noise(robot, exact, rng)


def add_noise(robot: Robot, exact: Signals, rng: np.random.Generator | None) -> Signals:
    """Signals with the noise of the robot's description, and NaN where it has no sensor.

    Args:
        robot: the robot.
        exact: signals of ideal sensors.
        rng: source of the noise; None: without noise.
    """
    tau, wrench, qd = exact.tau, exact.wrench, exact.qd
    if rng is not None:
        noise = robot.description.noise
        axes = np.array([noise.sensors[name] for name in robot.sensor_names]).reshape(-1, 6)
        tau = tau + rng.normal(size=tau.shape) * np.array(noise.tau)
        wrench = wrench + rng.normal(size=wrench.shape) * axes
        qd = qd + rng.normal(size=qd.shape) * np.array(noise.qd)
    tau = np.where(_measured(robot), tau, np.nan)
    return Signals(exact.time, exact.q, qd, tau, wrench)


def touch_loads(robot: Robot, q: Array, node: int, position: Array, force: Array) -> Array:
    """What a force (3,) at `position` (3,) on a node does to all joints and sensors (n + 6 k,)."""
    n = len(robot.joint_names)
    loads = np.zeros(n + 6 * len(robot.sensor_names))
    poses = robot.poses(q)
    while node >= 0:
        here, T = robot.nodes[node], poses[node]
        moment = np.cross(position - T[:3, 3], force)
        if here.coordinate >= 0:
            load = force if here.kind == "prismatic" else moment
            loads[here.coordinate] += here.multiplier * (T[:3, 2] @ load)
        if here.sensor is not None:
            at = n + 6 * robot.sensor_names.index(here.sensor)
            loads[at : at + 6] += np.concatenate([force @ T[:3, :3], moment @ T[:3, :3]])
        node = here.parent
    return loads


def _measured(robot: Robot) -> Mask:
    return np.array([joint.measured for joint in robot.description.joints])
