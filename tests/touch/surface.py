# SPDX-License-Identifier: Apache-2.0
"""Pushes on a robot's surface and the joint torques that they bring, by virtual work."""

import numpy as np

STEP = 1e-6  # rad


def place_on(skin, link, rng):
    """A random point (3,) of a link's surface and the way in (3,), in the link's frame."""
    surface = next(patch.surface for patch in skin.patches if patch.link == link)
    face = rng.choice(len(surface.faces), p=surface.areas / surface.areas.sum())
    return surface.vertices[surface.faces[face]].mean(axis=0), -surface.normals[face]


def torques(robot, q, link, point, force):
    """What a force (3,) [N] at a point, both in the link's frame, does to the joints (n,) [Nm].

    By differences of where the point is: the oracle of everything that knows levers.
    """

    def where(posture):
        T = robot.T_world_links(posture)[link]
        return T[:3, :3] @ point + T[:3, 3]

    world = robot.T_world_links(q)[link][:3, :3] @ force
    ways = [
        where(q + STEP * unit) - where(q - STEP * unit) for unit in np.eye(len(robot.joint_names))
    ]
    return np.array(ways) @ world / (2 * STEP)


def wavered(point, into, rng, direction=0.05, place=0.005):
    """A hand's next push: point (3,) and unit force (3,), off by so many radians and metres."""
    force = into + direction * rng.normal(size=3)
    off = place * rng.normal(size=3)
    return point + off - (off @ into) * into, force / np.linalg.norm(force)
