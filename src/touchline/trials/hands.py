# SPDX-License-Identifier: Apache-2.0
"""What hands do that are not still: forces that tremble, and contacts that slide over a link."""

from collections.abc import Callable

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.trials.touches import Touch, TouchSampler

TREMOR, SLOWEST, QUICKEST = 2.0, 1.0, 10.0  # N rms, of all three axes together; Hz
WAVES = 24  # of a tremor, of equal power
FAST, WAY = 0.15, 0.06  # m/s and m, of a contact that slides
WAITS, RESTS = 0.3, 0.3  # s: of the other contacts' being held, before and after that
HELD = 2.0  # s: for which hands that tremble stay
STEP = FAST * 1e-3  # m, of the path
WAYS = 12  # in which a slide is tried
LEAST = 1.0  # N: a finger that trembles still presses


def tremor(time: Array, rng: np.random.Generator) -> Array:
    """Changes of a force (N, 3) [N] about its mean, at times (N,) [s]."""
    frequency = 2 * np.pi * rng.uniform(SLOWEST, QUICKEST, (WAVES, 3))
    phase = rng.uniform(0.0, 2 * np.pi, (WAVES, 3))
    waves = np.sin(time[:, None, None] * frequency + phase).sum(axis=1)
    return np.asarray(TREMOR * np.sqrt(2.0 / (3.0 * WAVES)) * waves, dtype=np.float64)


def in_cone(force: Array, normal: Array, friction: float) -> Array:
    """Forces (N, 3) on a surface of that outward normal (3,); what slips is left out."""
    pressed = np.maximum(-force @ normal, LEAST)
    across = force + np.multiply.outer(-force @ normal, normal)
    size = np.linalg.norm(across, axis=1)
    kept = np.minimum(1.0, friction * pressed / np.maximum(size, 1e-12))
    return np.asarray(kept[:, None] * across - pressed[:, None] * normal, dtype=np.float64)


def slide(
    robot: Robot, sampler: TouchSampler, touch: Touch, friction: float, rng: np.random.Generator
) -> Array | None:
    """Places (N, 3) [m] in world of a contact that slides, `STEP` apart; None: nowhere to go.

    The force is constant in world and stays in its friction cone; a finger gets to every place.
    """
    T, mesh = robot.poses(touch.q)[touch.patch.node], touch.patch.mesh
    push = touch.force / np.linalg.norm(touch.force)

    def nearest(point: Array) -> tuple[Array, Array]:
        row = mesh.nearest_to_point(T[:3, :3].T @ (point - T[:3, 3]))[0]
        return T[:3, :3] @ row[2:5] + T[:3, 3], T[:3, :3] @ row[5:8]

    for _ in range(WAYS):
        path = _path(nearest, touch, rng, push, friction)
        if path is not None and all(sampler.reachable(touch.q, *at) for at in path[::50]):
            return np.array([place for place, _ in path])
    return None


def _path(
    nearest: Callable[[Array], tuple[Array, Array]],
    touch: Touch,
    rng: np.random.Generator,
    push: Array,
    friction: float,
) -> list[tuple[Array, Array]] | None:
    """Places and normals of a slide in a random direction; None where the force would slip off."""
    way, at, normal = rng.normal(size=3), touch.position, touch.normal
    path = [(at, normal)]
    for _ in range(round(WAY / STEP)):
        along = way - (way @ normal) * normal
        place, normal = nearest(at + STEP * along / np.linalg.norm(along))
        moved = float(np.linalg.norm(place - at))
        if not 0.5 * STEP < moved < 1.5 * STEP:
            return None
        if -push @ normal < 1.0 / np.sqrt(1.0 + friction**2):
            return None
        at = place
        path.append((at, normal))
    return path
