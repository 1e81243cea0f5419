# SPDX-License-Identifier: Apache-2.0
"""What the numbers of native answers say (see `core/answer_rows.hpp`).

A row of a contact that is followed has the columns SAMPLE to RATE, then an answer; one of an event
that ended has SAMPLE, SEGMENT and NUMBER, then the event.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from touchline.localizer.skin import Patch
from touchline.model.robot import Robot
from touchline.result.contact import Candidate
from touchline.result.event import EventAnswer

Array = NDArray[np.float64]

SAMPLE, SEGMENT, NUMBER, SHARE, KIND, CLAMPED, RATE = range(7)
ANSWER, ENDED = 7, 3  # where the answer and the event begin

STATUS = (None, "located", "ambiguous", "not_separable", "wrench_only")
SURFACE, NODE, PROBABILITY = 1, 2, 3  # columns of an answer; the first is the status
POSITION, FORCE, COVARIANCE = slice(4, 7), slice(7, 10), slice(10, 19)
PITCH, CHI2, DEGREES, RANK, UNKNOWNS, COUNT, HEAD = range(19, 26)
OF_CANDIDATE, OF_PLACE = 7, 6  # numbers of a candidate, and of a place of an event


@dataclass(frozen=True)
class Names:
    """Whom the numbers mean: the links' surfaces, and the bodies by their node."""

    patches: Sequence[Patch]
    bodies: dict[int, str]


class Answer:
    """Where a segment is touched at one instant; what is not known is None.

    Args:
        row: a native answer.
        names: of the robot.

    Attributes:
        status: "located", "ambiguous", "not_separable" or "wrench_only"; None without a
            measurement.
    """

    __slots__ = ("_row", "_names", "_placed", "status")

    def __init__(self, row: Array, names: Names) -> None:
        self._row, self._names = row, names
        status = int(row[0])
        self.status = STATUS[status]
        self._placed = 0 < status < 3

    @property
    def link(self) -> str | None:
        """The link that carries the point."""
        return self._names.patches[int(self._row[SURFACE])].link if self._placed else None

    @property
    def body(self) -> str | None:
        """The rigid body that the link belongs to."""
        return self._names.bodies[int(self._row[NODE])] if self._placed else None

    @property
    def body_probability(self) -> float | None:
        """Of that body, 0 to 1."""
        return float(self._row[PROBABILITY]) if self._placed else None

    @property
    def position(self) -> Array | None:
        """(3,) [m] in world; None where no point is an honest answer."""
        return self._row[POSITION] if self._placed else None

    @property
    def force(self) -> Array | None:
        """(3,) [N] on the robot, in world."""
        force = self._row[FORCE]
        return force if self._placed or np.isfinite(force).all() else None

    @property
    def covariance(self) -> Array | None:
        """(3, 3) [m2] of the position, along the surface."""
        return self._row[COVARIANCE].reshape(3, 3) if self._placed else None

    @property
    def pitch(self) -> float | None:
        """How far the wrench is from that of one pure force [standard deviations]."""
        return float(self._row[PITCH]) if self._row[COUNT] else None

    @property
    def chi2(self) -> float | None:
        """Misfit of the best explanation, with `degrees` of freedom."""
        return float(self._row[CHI2]) if self._row[COUNT] else None

    @property
    def degrees(self) -> int:
        """Degrees of freedom of `chi2`."""
        return int(self._row[DEGREES]) if self._row[COUNT] else 0

    @property
    def rank(self) -> int | None:
        """Independent equations, for the `unknowns`, where none is left over."""
        return int(self._row[RANK]) or None

    @property
    def unknowns(self) -> int | None:
        """Two for each place, three for each force, where no equation is left over."""
        return int(self._row[UNKNOWNS]) or None

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All explanations, best first."""
        row, names = self._row, self._names
        parts = row[HEAD:].reshape(-1, OF_CANDIDATE)[: int(row[COUNT])]
        return tuple(
            Candidate(
                names.patches[int(surface)].link,
                names.bodies[int(node)],
                float(weight),
                part[3:6],
                float(part[6]),
            )
            for surface, node, weight, part in ((*part[:3], part) for part in parts)
        )


def event_answer(row: Array, names: Names, robot: Robot) -> EventAnswer:
    """Names the numbers of a native event."""
    status = STATUS[int(row[0])] or "wrench_only"
    n = len(robot.joint_names)
    time, variance, q = float(row[1]), float(row[2]), row[4 : 4 + n]
    places = row[4 + n :].reshape(-1, OF_PLACE)[: int(row[3])]
    poses = robot.poses(q) if len(places) else np.empty((0, 4, 4))
    candidates = tuple(_candidate(place, poses, names) for place in places)
    if status not in ("located", "ambiguous"):
        return EventAnswer(status, candidates=candidates)
    best = candidates[0]
    T_node_link = names.patches[int(places[0][0])].T_node_link
    return EventAnswer(
        status,
        best.link,
        best.body,
        sum(other.probability for other in candidates if other.body == best.body),
        best.position,
        T_node_link[:3, :3].T @ (places[0][3:] - T_node_link[:3, 3]),
        time,
        float(np.sqrt(variance)),
        candidates,
    )


def _candidate(place: Array, poses: Array, names: Names) -> Candidate:
    surface, node, share = place[:3]
    T = poses[int(node)]
    position = T[:3, :3] @ place[3:] + T[:3, 3]
    link = names.patches[int(surface)].link
    return Candidate(link, names.bodies[int(node)], float(share), position)
