# SPDX-License-Identifier: Apache-2.0
"""All contacts of one instant on the page, felt and true."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import viser
from numpy.typing import NDArray

from touchline.contact.contact import Contact
from touchline.contact.line import line_point
from touchline.model.robot import Robot
from touchline.view.markers import ContactMarker
from touchline.view.scene import RobotScene

if TYPE_CHECKING:  # a replay needs no simulation, which takes a while to import
    from touchline.view.judge import Touched, Verdict

Array = NDArray[np.float64]

PULL = (120, 124, 130)
LIKELY = 0.02  # candidates less probable are not shown


class ContactScene:
    """Marks what is felt and what is true, and colours the links where it is felt.

    Args:
        scene: of a viser server.
        arm: on which they are.
    """

    def __init__(self, scene: viser.SceneApi, arm: RobotScene) -> None:
        self._scene, self._arm = scene, arm
        self._markers: dict[str, list[ContactMarker]] = {}
        self._used: dict[str, int] = {}
        self._pulls = scene.add_line_segments(
            "/pulls", np.zeros((1, 2, 3)), PULL, thickness=3.0, thickness_units="screen"
        )

    def show_pulls(self, ends: Sequence[tuple[Array, Array]]) -> None:
        """Draws the springs by which visitors pull, between points (3,) in world [m]."""
        self._pulls.visible = bool(ends)
        if ends:
            self._pulls.points = np.array(ends, np.float32)

    def show(self, verdicts: "Sequence[Verdict]", true: "Sequence[Touched]", q: Array) -> None:
        """Shows one instant, at joint positions `q` (n,) [rad]."""
        self._used = {}
        links: dict[int, set[str]] = {0: set(), 1: set(), 2: set()}
        for contact in true:
            self._next("truth").show(contact.point, contact.force)
        for verdict in verdicts:
            if verdict.contact is not None:
                self._show(verdict.contact, q)
                if verdict.contact.link is not None:
                    links[verdict.level].add(verdict.contact.link)
        self._arm.tint(frozenset(links[1]), frozenset(links[2]))
        for kind, markers in self._markers.items():
            for marker in markers[self._used.get(kind, 0) :]:
                marker.hide()

    def _show(self, contact: Contact, q: Array) -> None:
        if contact.position is not None:
            self._next("estimate").show(
                contact.position, contact.force, contact.covariance, line=True
            )
        elif contact.wrench is not None:
            at = stand_in(self._arm.robot, contact, q)
            self._next("estimate").show(at, contact.wrench[:3], is_point=False, line=True)
        if contact.status in ("ambiguous", "not_separable"):
            for candidate in contact.candidates:
                if candidate.probability > LIKELY:
                    self._next("candidate").show(candidate.position)

    def _next(self, kind: str) -> ContactMarker:
        """A marker that has not been used at this instant."""
        number = self._used.get(kind, 0)
        self._used[kind] = number + 1
        markers = self._markers.setdefault(kind, [])
        if number == len(markers):
            markers.append(ContactMarker(self._scene, f"/contacts/{kind}{number}", kind))
        return markers[number]


def stand_in(robot: Robot, contact: Contact, q: Array) -> Array:
    """Where to draw a force (3,) whose point is not known: on its line of action, near the arm.

    Near the best guess where there is one, otherwise near the middle of the segment.
    """
    assert contact.wrench is not None
    if contact.candidates:
        near = contact.candidates[0].position
    else:
        poses = robot.T_world_links(q)
        own = [body.links for body in robot.bodies if body.segment == contact.segment]
        near = np.mean([poses[link][:3, 3] for links in own for link in links], axis=0)
    start, force = line_point(contact.wrench), contact.wrench[:3]
    return start + (near - start) @ force / (force @ force) * force
