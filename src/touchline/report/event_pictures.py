# SPDX-License-Identifier: Apache-2.0
"""Two pictures of an event: where the arm was touched, and how hard."""

from collections.abc import Sequence

import numpy as np

from touchline.arrays import Floats
from touchline.model.robot import Robot
from touchline.report.comparison import Comparison
from touchline.report.figure import svg_picture
from touchline.report.picture import Scene
from touchline.report.render.camera import Size
from touchline.report.views import views_of_contact
from touchline.result.event import Event

SIZE = (520, 390)
WORTH_DRAWING = 0.03  # probability of a candidate


class EventPoses:
    """Remembers, while a recording streams by, how the arm stood at each event."""

    def __init__(self) -> None:
        self._poses: dict[int, Floats] = {}

    def add(self, time: Floats, q: Floats, events: Sequence[Event]) -> None:
        """Take N samples: `time` (N,) [s], `q` (N, n), and the events found so far."""
        usable = np.flatnonzero(np.isfinite(time) & np.isfinite(q).all(axis=1))
        if not len(usable):
            return
        first, last = time[usable].min(), time[usable].max()
        for event in events:
            wanted = event.detected if event.time_of_position is None else event.time_of_position
            if first <= wanted <= last:
                nearest = usable[np.abs(time[usable] - wanted).argmin()]
                self._poses[event.id] = np.array(q[nearest], float)

    def get(self, event: Event) -> Floats | None:
        """Joint positions (n,) at an event; None where they are not known."""
        return self._poses.get(event.id)


def truth_of(event: Event, comparisons: Sequence[Comparison]) -> list[tuple[Floats, Floats]]:
    """Point and force of the true contact that an event found, at the event's time."""
    found = [row for row in comparisons if row.event is event]
    time = event.time_of_position or event.detected
    return [(row.truth.point_at(time), row.truth.mean_force) for row in found]


def event_pictures(scene: Scene, event: Event, size: Size = SIZE) -> str:
    """Two pictures of an event from two sides, as SVG elements.

    Args:
        scene: what they show, as of `event_scene`.
        event: what was found.
        size: of each [pixels].
    """
    name = f"event {event.id}: {caption(event)}"
    cameras = views_of_contact(scene, size[0] / size[1])
    return "".join(svg_picture(scene, camera, size, name) for camera in cameras)


def event_scene(
    robot: Robot, event: Event, q: Floats, truth: Sequence[tuple[Floats, Floats]] | None = None
) -> Scene:
    """What the pictures of an event show.

    Args:
        robot: the robot.
        event: what was found; without a position its segment is tinted.
        q: joint positions (n,) [rad] at the event.
        truth: points (3,) [m] and forces (3,) [N] on the robot, in world, where they are known.
    """
    scene = Scene(robot, q)
    for point, force in truth or ():
        scene.add_contact(point, force, "truth")
    position = _position(robot, event, q)
    if position is not None and event.link is not None:
        scene.highlight(event.link)
        covariance = _disc(scene, event, position)
        scene.add_contact(position, event.force, "estimate", covariance)
    else:
        _show_doubt(scene, event)
    return scene


def _position(robot: Robot, event: Event, q: Floats) -> Floats | None:
    """The event's point (3,) in world, on the link as it stands at `q`."""
    if event.position_link is None or event.link is None:
        return event.position
    T = robot.T_world_links(np.asarray(q, np.float64))[event.link]
    return T[:3, :3] @ event.position_link + T[:3, 3]


def _disc(scene: Scene, event: Event, position: Floats) -> Floats | None:
    """A covariance (3, 3) [m2] along the surface with the trace that the event tells."""
    if event.position_std is None or event.link is None:
        return None
    normal = scene.normal_at(event.link, position)
    if normal is None:
        return None
    return event.position_std**2 / 2 * (np.eye(3) - np.outer(normal, normal))


def _show_doubt(scene: Scene, event: Event) -> None:
    """Candidates where there are some, else all that could have been touched."""
    candidates = [c for c in event.candidates if c.probability >= WORTH_DRAWING]
    for candidate in candidates:
        scene.highlight(candidate.link, 0.25 + 0.75 * candidate.probability)
        words = f"{100 * candidate.probability:.0f} %"
        scene.add_contact(candidate.position, None, "candidate", label=words)
    links = {link for b in scene.robot.bodies if b.segment == event.segment for link in b.links}
    if not candidates:
        for link in links:
            scene.highlight(link, 0.55)
    if event.force is not None:
        where = _middle(scene, links, event.force, [c.position for c in candidates])
        scene.add_contact(where, event.force, is_point=False)


def _middle(scene: Scene, links: set[str], force: Floats, points: list[Floats]) -> Floats:
    """A place (3,) for the arrow of a force whose point is not known."""
    if points:
        return np.asarray(points[0])
    own = np.array([piece.link in links for piece in scene.pieces], bool)[scene.surface.part]
    corners = scene.surface.corners[own if own.any() else slice(None)].reshape(-1, 3)
    middle = (corners.min(axis=0) + corners.max(axis=0)) / 2
    # Back along the force to the outside of it all, where the arrow is seen.
    back = -force / np.linalg.norm(force)
    near = corners[np.linalg.norm(np.cross(corners - middle, back), axis=1) < 0.05]
    reach = ((near - middle) @ back).max(initial=0.0) if len(near) else 0.0
    return middle + back * reach


def caption(event: Event, origin: float = 0.0) -> str:
    """What was found, in a line; times count from `origin` [s]."""
    words = [event.level, f"at {event.detected - origin:.3f} s on {event.link or event.segment}"]
    if event.force is not None:
        words.append(f"{float(np.linalg.norm(event.force)):.1f} N")
    if event.position_std is not None and event.link is not None:
        words.append(f"uncertainty {1e3 * event.position_std:.1f} mm")
    if event.status != "located":
        words.append(event.status.replace("_", " "))
    return ", ".join(words)
