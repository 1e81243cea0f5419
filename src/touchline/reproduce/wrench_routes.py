# SPDX-License-Identifier: Apache-2.0
"""Force and point of a contact by each method, at one instant of a log."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.observer.classical import ClassicalObserver
from touchline.observer.joint_momentum import tool_wrench
from touchline.reproduce.replay import FORCE, Replay
from touchline.simulation.truth import filter_truth

METHODS = ("eq5", "classical", "ours")
NAMES = {"eq5": "joint torques, (5)", "classical": "classical, (6)", "ours": "ours"}
WEAK = 0.1  # a smaller force has no line of action [N]
NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True)
class Found:
    """What a method says of a contact: force (3,) [N] and point (3,) [m] in world, and the link.

    What it does not know is NaN, or None.
    """

    force: Array
    point: Array
    link: str | None


class Routes:
    """All methods on one log.

    Args:
        replay: of a robot with a torque sensor in every joint.
    """

    def __init__(self, replay: Replay) -> None:
        self.replay, self.robot = replay, replay.robot
        self.skin: Skin = replay.pipeline.skin

    @cached_property
    def _classical(self) -> Array:
        """Segment wrenches (N, m, 6) by eq. (6), low-passed like the observer's, to be fair."""
        bandwidth = self.robot.description.bandwidth_joints[0]
        wrench = ClassicalObserver(self.robot).run(*self.replay.signals).segment_wrench
        return filter_truth(wrench, self.replay.time, bandwidth)

    def found(self, method: str, row: int, segment: str, link: str) -> Found:
        """What a method says of a contact at a sample.

        Args:
            method: one of `METHODS`.
            row: the sample.
            segment: that is touched.
            link: that is touched; only eq. (5) makes use of it, which cannot do without.
        """
        if method == "ours":
            force = self.replay.wrench(segment)[row, FORCE]
            name = self._links[segment][row]
            return Found(force, self._points[segment][row], name)
        if method == "classical":
            wrench = self._classical[row, self.robot.segment_names.index(segment)]
            return self._along_line(wrench, row, segment, None)
        return self._along_line(self._joint_route(row, link), row, None, link)

    @cached_property
    def _points(self) -> dict[str, Array]:
        return {s: self.replay.located(s) for s in self.robot.segment_names}

    @cached_property
    def _links(self) -> dict[str, NDArray[np.object_]]:
        return {s: self.replay.links(s) for s in self.robot.segment_names}

    def _joint_route(self, row: int, link: str) -> Array:
        """The wrench (6,) about the world's origin by eq. (5), told the touched link."""
        q = self.replay.signals[1][row]
        wrench = tool_wrench(self.robot, q, self.replay.estimate.tau_ext[row], link).wrench
        origin = self.robot.T_world_links(q)[link][:3, 3]
        return np.r_[wrench[:3], wrench[3:] + np.cross(origin, wrench[:3])]

    def _along_line(self, wrench: Array, row: int, segment: str | None, link: str | None) -> Found:
        """The first entry of the line of force action (19), as the paper locates a contact."""
        force, moment = wrench[:3], wrench[3:]
        if not np.linalg.norm(force) > WEAK:
            return Found(force, NOWHERE, None)
        origin = np.cross(force, moment) / (force @ force)
        q = self.replay.signals[1][row]
        for crossing in self.skin.crossings(q, origin, force, segment):
            if crossing.entry and link in (None, crossing.link):
                return Found(force, crossing.position, crossing.link)
        return Found(force, NOWHERE, None)
