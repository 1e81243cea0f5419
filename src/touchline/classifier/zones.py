# SPDX-License-Identifier: Apache-2.0
"""Which part of a robot is meant to be touched: structure, end effector or handle."""

from touchline.model.robot import Robot
from touchline.result.kinds import Zone


class Zones:
    """The zone of every link and segment.

    What `policy.zones` does not say is a handle where the segment or link is called so, an end
    effector where nothing else is carried, and structure everywhere else.

    Args:
        robot: the robot.
    """

    def __init__(self, robot: Robot) -> None:
        given = robot.description.policy.zones
        parents = {node.parent for node in robot.nodes}
        self._links: dict[str, Zone] = {}
        self._segments: dict[str, set[Zone]] = {name: set() for name in robot.segment_names}
        for body in robot.bodies:
            for link in body.links:
                zone = given.get(link) or given.get(body.segment)
                zone = zone or _guess(body.segment, link, body.node not in parents)
                self._links[link] = Zone(zone)
                self._segments.setdefault(body.segment, set()).add(Zone(zone))
        self._onset = vars(robot.description.policy.onset)

    def of(self, segment: str, link: str | None = None) -> Zone | None:
        """The zone of a link, or of a segment if it has only one; None where that is open."""
        if link is not None:
            return self._links.get(link)
        zones = self._segments.get(segment, set())
        return next(iter(zones)) if len(zones) == 1 else None

    def onset(self, segment: str) -> float:
        """The rate of force [N/s] of a collision on a segment: the lowest of its zones."""
        zones = self._segments.get(segment) or {Zone.STRUCTURE}
        return min(self._onset[zone] for zone in zones)


def _guess(segment: str, link: str, outermost: bool) -> Zone:
    if "handle" in (segment, link):
        return Zone.HANDLE
    return Zone.END_EFFECTOR if outermost and segment != "root" else Zone.STRUCTURE
