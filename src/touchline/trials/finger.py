# SPDX-License-Identifier: Apache-2.0
"""A simulated finger on a simulated arm: it presses, slides and writes, and sensors report it.

The dynamics are those of the classical methods, which share no code with the observer.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Patch, Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads, inverse_dynamics
from touchline.trials.touches import Signals, add_noise

LANDING = 0.04  # s in which the force of a finger rises and falls
SLOPE = 0.75  # cosine; a pad whose surface turns away more is no place to write
HEIGHT = 0.02  # m; nor is one that rises more above its plane


@dataclass(frozen=True)
class Finger:
    """A finger's way on a link, sample by sample.

    Attributes:
        link: that it is on.
        point: (N, 3) [m] and `force` (N, 3) [N] on the robot, in the link's frame; force zero
            while it does not touch.
    """

    link: str
    point: Array
    force: Array


def find_pad(
    skin: Skin,
    links: tuple[str, ...],
    width: float,
    height: float,
    rng: np.random.Generator,
    posture: Array | None = None,
) -> tuple[Array, Patch, WidgetDescription]:
    """A random place for a pad that a finger can reach in a random posture.

    Args:
        skin: the robot's surfaces.
        links: on one of which it is to be.
        width: along its u [m].
        height: along its v [m].
        rng: source of chance.
        posture: joint positions (n,) [rad or m]; default: random ones.

    Returns:
        Joint positions (n,), the link's surface, and the pad.
    """
    patches = [patch for patch in skin.patches if patch.link in links and patch.segment]
    q = rng.uniform(*skin.robot.ranges) if posture is None else posture
    while True:
        patch = patches[rng.integers(len(patches))]
        surface = patch.surface
        face = rng.choice(len(surface.faces), p=surface.areas / surface.areas.sum())
        at, n = surface.vertices[surface.faces[face]].mean(axis=0), surface.normals[face]
        up = rng.normal(size=3)
        up -= (up @ n) * n
        up /= np.linalg.norm(up)
        given = WidgetDescription(
            "pad", patch.link, at=tuple(at), up=tuple(up), size=(width, height), normal=tuple(n)
        )
        corners = np.array([[u, v] for u in (-0.5, 0.5, 0.0) for v in (-0.5, 0.5, 0.0)])
        corners = corners * [width, height]
        if project(patch, given, corners) is None:
            continue
        if _reachable(skin, q, patch, given, corners):
            return q, patch, given
        q = rng.uniform(*skin.robot.ranges) if posture is None else posture


def project(patch: Patch, given: WidgetDescription, way: Array) -> tuple[Array, Array] | None:
    """Places (N, 3) and outward normals (N, 3) on the surface over points (N, 2) of a pad.

    In the link's frame; None where the surface is not flat enough or ends.
    """
    n, v = np.array(given.normal), np.array(given.up)
    u, at = np.cross(v, n), np.array(given.at)
    R, p = patch.T_node_link[:3, :3], patch.T_node_link[:3, 3]
    points, normals = [], []
    for x, y in way:
        above = at + x * u + y * v + 0.1 * n
        rows = [r for r in patch.mesh.crossings(R @ above + p, -(R @ n)) if 0.0 < r[0]]
        if not rows:
            return None
        t = min(float(row[0]) for row in rows)
        normal = R.T @ np.array(min(rows, key=lambda row: row[0])[2:5])
        if abs(t - 0.1) > HEIGHT or normal @ n < SLOPE:
            return None
        points.append(above - t * n)
        normals.append(normal)
    return np.array(points), np.array(normals)


def _reachable(skin: Skin, q, patch: Patch, given: WidgetDescription, corners: Array) -> bool:
    placed = project(patch, given, corners)
    if placed is None:
        return False
    T = skin.robot.poses(q)[patch.node] @ patch.T_node_link
    for point, normal in zip(*placed, strict=True):
        world, outward = T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ normal
        if world[2] < 0.02 or skin.links_around(q, world + 1e-4 * outward):
            return False
        if any(1e-4 < c.distance < 0.1 for c in skin.crossings(q, world, outward)):
            return False
    return True


def rising(time: Array, begin: float, end: float) -> Array:
    """0 before and after a press, 1 in it, with smooth flanks of `LANDING`."""
    up = np.clip((time - begin) / LANDING, 0.0, 1.0)
    down = np.clip((end - time) / LANDING, 0.0, 1.0)
    return 0.25 * (1 - np.cos(np.pi * up)) * (1 - np.cos(np.pi * down))


def sliding(
    patch: Patch,
    given: WidgetDescription,
    way: Array,
    time: Array,
    begin: float,
    end: float,
    force: Array,
    friction: float,
) -> Finger | None:
    """A finger that follows a way (M, 2) on a pad at even speed between two instants.

    Args:
        patch: the link's surface.
        given: the pad.
        way: points on it [m].
        time: (N,) of all samples [s].
        begin: when it lands [s]; it lifts at `end` [s].
        end: see `begin`.
        force: (N,) [N] normal to the surface while it presses.
        friction: of the finger, which drags the surface along.
    """
    steps = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way, axis=0), axis=1))])
    fine = np.linspace(0.0, steps[-1], 120)
    even = np.column_stack([np.interp(fine, steps, way[:, i]) for i in (0, 1)])
    placed = project(patch, given, even)
    if placed is None:
        return None
    part = np.clip((time - begin) / (end - begin), 0.0, 1.0) * fine[-1]
    points, normals = (
        np.column_stack([np.interp(part, fine, values[:, i]) for i in range(3)])
        for values in placed
    )
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    speed = np.gradient(points, time, axis=0)
    size = np.linalg.norm(speed, axis=1, keepdims=True)
    drag = friction * speed / np.maximum(size, 1e-3)
    pressed = (force * rising(time, begin, end))[:, None]
    return Finger(patch.link, points, pressed * (drag - normals))


def press(
    point: Array, normal: Array, link: str, time: Array, begin: float, end: float, force: float
) -> Finger:
    """A finger that presses at a place (3,) against its outward normal (3,), in the link's frame.

    Args:
        point: [m].
        normal: unit vector.
        link: that is pressed.
        time: (N,) of all samples [s].
        begin: when it lands; it lifts at `end` [s].
        end: see `begin`.
        force: [N].
    """
    size = (force * rising(time, begin, end))[:, None]
    return Finger(link, np.tile(point, (len(time), 1)), -size * normal)


def middle_of(patch: Patch, given: WidgetDescription) -> tuple[Array, Array]:
    """Place (3,) [m] and outward normal (3,) in the middle of a pad, in the link's frame."""
    placed = project(patch, given, np.zeros((1, 2)))
    assert placed is not None  # `find_pad` looked there
    return placed[0][0], placed[1][0]


def reaching(part: float) -> float:
    """How long a landing finger takes to a part of its force [s]."""
    return float(np.arccos(1 - 2 * min(part, 1.0)) / np.pi * LANDING)


def times(delays: list[float]) -> str:
    """Median and 99th percentile of delays [s], in ms."""
    if not delays:
        return "-"
    return f"{1e3 * np.median(delays):.0f}, {1e3 * np.percentile(delays, 99):.0f} ms"


def signals_of(
    robot: Robot,
    q: Array,
    fingers: list[Finger],
    time: Array,
    speed: float,
    rng: np.random.Generator,
    noise: np.random.Generator | None,
) -> Signals:
    """What the sensors report while the arm swings about `q` (n,) and fingers touch it.

    Args:
        robot: the robot, whose description says how noisy its sensors are.
        q: joint positions (n,) [rad or m] in the middle.
        fingers: that touch it.
        time: (N,) [s].
        speed: the largest of every joint, at 0.25 Hz [rad/s or m/s]; 0: it stands.
        rng: source of the phases.
        noise: source of the noise; None: without.
    """
    pulse = 2 * np.pi * 0.25
    phase = rng.uniform(0.0, 2 * np.pi, len(q))
    angle = pulse * time[:, None] + phase
    way = speed / pulse * np.sin(angle)
    qd, qdd = speed * np.cos(angle), -speed * pulse * np.sin(angle)
    poses = q + way
    needed = inverse_dynamics(robot, poses, qd, qdd)
    tau, wrench = needed.torque, needed.wrench
    for finger in fingers:
        place = robot.places[finger.link]
        T = np.array([robot.poses(row)[place.node] @ place.T_node_link for row in poses])
        point = np.einsum("nij,nj->ni", T[:, :3, :3], finger.point) + T[:, :3, 3]
        force = np.einsum("nij,nj->ni", T[:, :3, :3], finger.force)
        loads = contact_loads(robot, poses, finger.link, np.hstack([force, np.cross(point, force)]))
        tau, wrench = tau - loads.torque, wrench - loads.wrench
    return add_noise(robot, Signals(time, poses, qd, tau, wrench), noise)
