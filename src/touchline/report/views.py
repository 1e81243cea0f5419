# SPDX-License-Identifier: Apache-2.0
"""From where a contact is seen well."""

import numpy as np

from touchline.arrays import Floats, Mask
from touchline.report.picture import Mark, Scene
from touchline.report.render.camera import Camera

AZIMUTHS = np.deg2rad(np.arange(0, 360, 30))
ELEVATIONS = np.deg2rad([10.0, 30.0])
PREFERRED = np.deg2rad(18.0)
OFF = 0.015  # m; how far before the point the line of sight to it ends


def views_of_contact(scene: Scene, aspect: float = 1.0) -> tuple[Camera, Camera]:
    """Two cameras that frame the scene from different sides and see its contacts.

    A good view sees points and arrows unhidden, and the arrows from the side; the second is the
    best of those some 90 degrees around from the first.

    Args:
        scene: with its contacts.
        aspect: width of the images by their height.
    """
    directions = _directions()
    scores = _scores(scene, directions)
    first = directions[scores.argmax()]
    level = directions[:, :2] / np.linalg.norm(directions[:, :2], axis=1)[:, None]
    turned = level @ first[:2] / np.linalg.norm(first[:2])
    second = directions[(scores + 1.2 * (1 - turned**2) - 3.0 * (turned > 0.6)).argmax()]
    points = scene.points()
    return Camera.framing(points, first, aspect), Camera.framing(points, second, aspect)


def sees(scene: Scene, point: Floats, directions: Floats) -> Mask:
    """Whether nothing of the robot lies between a point and far eyes, (D,).

    Args:
        scene: with the robot.
        point: (3,) [m] in world.
        directions: (D, 3) unit vectors from the point to the eyes.
    """
    rays = np.ascontiguousarray(directions, np.float64)
    return np.array(scene.posed.sees(np.asarray(point, np.float64), rays, _off(scene)), bool)


def _off(scene: Scene) -> float:
    return OFF * scene.extent / 1.5


def _directions() -> Floats:
    """Directions (N, 3) from the robot to where the camera may be."""
    azimuth, elevation = (x.ravel() for x in np.meshgrid(AZIMUTHS + 0.35, ELEVATIONS))
    level = np.cos(elevation)
    return np.column_stack([level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])


def _scores(scene: Scene, directions: Floats) -> Floats:
    """How good the views from directions (D, 3) are."""
    scores = -0.8 * np.abs(np.arcsin(directions[:, 2]) - PREFERRED)
    # The arm from its side: spread out rather than foreshortened.
    points = scene.outline
    middle = points - points.mean(axis=0)
    moments = middle.T @ middle
    shortened = np.einsum("di,ij,dj->d", directions, moments, directions) / np.trace(moments)
    scores += 0.8 * np.sqrt((1 - shortened).clip(0))
    marks = [mark for mark in scene.marks if mark.kind != "candidate"] or scene.marks
    for mark in marks:
        scores += _mark_scores(scene, mark, directions) / len(marks)
    return scores


def _mark_scores(scene: Scene, mark: Mark, directions: Floats) -> Floats:
    """How well a mark is seen: its point unhidden, its arrow unhidden and from the side."""
    tail, tip = scene.arrow(mark)
    scores = 1.5 * sees(scene, tip, directions)
    if mark.force is not None:
        along = mark.force / np.linalg.norm(mark.force)
        side = 1 - (directions @ along) ** 2
        scores += 0.5 * sees(scene, (tail + tip) / 2, directions) + 1.2 * np.minimum(side, 0.6)
    return scores
