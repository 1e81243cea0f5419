# SPDX-License-Identifier: Apache-2.0
"""All contacts of one instant on the page, felt and true."""

from collections.abc import Sequence

import numpy as np
import viser

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.result.contact import Candidate, Contact
from touchline.result.line import line_point
from touchline.view.markers import ContactMarker
from touchline.view.scene import RobotScene

PULL = (120, 124, 130)
LIKELY, MOST_CANDIDATES = 0.03, 12  # candidates less probable, or more, are not shown


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

    def show(
        self, contacts: Sequence[Contact], true: Sequence[tuple[Array, Array]], q: Array
    ) -> None:
        """Shows one instant.

        Args:
            contacts: that are felt.
            true: points (3,) [m] and forces (3,) [N] of those that there are, in world.
            q: (n,) joint positions [rad or m].
        """
        self._used = {}
        links: dict[str, set[str]] = {"contact": set(), "collision": set()}
        for point, force in true:
            self._next("truth").show(point, force)
        for contact in contacts:
            if contact.position is not None and contact.link is not None:
                links[contact.level].add(contact.link)
                self._next("estimate").show(
                    contact.position, contact.force, contact.covariance, line=True
                )
            else:
                links[contact.level] |= self._show_doubt(contact, q)
        self._arm.tint(frozenset(links["contact"]), frozenset(links["collision"]))
        for kind, markers in self._markers.items():
            for marker in markers[self._used.get(kind, 0) :]:
                marker.hide()

    def _show_doubt(self, contact: Contact, q: Array) -> set[str]:
        """Candidates where there are some, else all that could have been touched; its links."""
        likely = candidates(contact)
        for candidate in likely:
            self._next("candidate").show(candidate.position)
        if contact.wrench is not None and np.linalg.norm(contact.wrench[:3]) > 0:
            at = stand_in(self._arm.robot, contact, q)
            self._next("estimate").show(at, contact.wrench[:3], is_point=False, line=True)
        if likely:
            return {candidate.link for candidate in likely}
        bodies = [body for body in self._arm.robot.bodies if body.segment == contact.segment]
        return {link for body in bodies for link in body.links}

    def _next(self, kind: str) -> ContactMarker:
        """A marker that has not been used at this instant."""
        number = self._used.get(kind, 0)
        self._used[kind] = number + 1
        markers = self._markers.setdefault(kind, [])
        if number == len(markers):
            markers.append(ContactMarker(self._scene, f"/contacts/{kind}{number}", kind))
        return markers[number]


def candidates(contact: Contact) -> list[Candidate]:
    """Those that are worth showing."""
    return [c for c in contact.candidates if c.probability >= LIKELY][:MOST_CANDIDATES]


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
