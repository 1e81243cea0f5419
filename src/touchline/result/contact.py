# SPDX-License-Identifier: Apache-2.0
"""What Touchline says of one contact."""

from dataclasses import dataclass, field

import numpy as np

from touchline.arrays import Array
from touchline.result.kinds import ContactLevel, Status
from touchline.result.line import line_point
from touchline.result.native import CONTACT, decoders
from touchline.value import Value, lazily

UNKNOWNS = 5  # of one contact


@dataclass(frozen=True, eq=False, repr=False)
class Candidate(Value):
    """One explanation of a contact: `position` (3,) [m] in world on `link`, of rigid `body`.

    Where contacts cannot be told apart, it stands for the part of the link within `radius` [m].
    """

    link: str
    body: str
    probability: float
    position: Array
    radius: float = 0.0


def least_contacts(status: str, unknowns: int | None) -> int | None:
    """How many contacts there are at least, where an answer has a status and so many unknowns."""
    if status in ("located", "ambiguous"):
        return 1
    return unknowns // UNKNOWNS if unknowns else None


@dataclass(frozen=True, eq=False, repr=False)
class Contact(Value):
    """A contact on one segment at one instant; what is not known is None.

    One of a pipeline works its attributes out when they are asked for.

    Attributes:
        segment: name of the segment.
        event: number of the event that it belongs to.
        level: "contact" or "collision"; "contact" until the contrary is known.
        status: "located", "ambiguous", "not_separable" or "wrench_only".
        wrench: (6,) [N, Nm] what acts on the segment, world axes, about the world origin; None on
            `root`.
        link: the link that carries the point, and `body` the rigid body that it belongs to.
        body_probability: how likely that body is touched, 0 to 1.
        position: (3,) [m] the touched point in world.
        force: (3,) [N] the force on the robot, world axes.
        covariance: (3, 3) [m2] covariance of the position.
        candidates: other explanations, best first.
        decided: whether the level is more than a default.
        searching: whether a search for places still runs, that will say more: some hundredths of a
            second after contacts have begun together.
        zone: "structure", "end_effector" or "handle"; None while that is open.
        clamped: whether forces on two sides oppose each other; None where that is not known.
        rate: how fast the force grows [N/s].
        rank: where no equation is left over, for one contact (joint torques alone) or for several
            that begin together: how many independent ones there are, for the `unknowns` (two for
            each place, three for each force). With fewer than unknowns no place is named.
        pitch: how far the segment's wrench is from that of one pure force [standard deviations].
        chi2: misfit of the best explanation, with `degrees` of freedom.
    """

    segment: str
    event: int
    level: ContactLevel | str
    status: Status | str = Status.WRENCH_ONLY
    wrench: Array | None = None
    link: str | None = None
    body: str | None = None
    body_probability: float | None = None
    position: Array | None = None
    force: Array | None = None
    covariance: Array | None = None
    candidates: tuple[Candidate, ...] = field(default=())
    decided: bool = False
    searching: bool = False
    zone: str | None = None
    clamped: bool | None = False
    rate: float | None = None
    rank: int | None = None
    unknowns: int | None = None
    pitch: float | None = None
    chi2: float | None = None
    degrees: int | None = None

    @property
    def at_least(self) -> int | None:
        """How many pushes explain what is measured, at least; None where that is not known.

        One where a place is named. Contacts that cannot be told apart are one `Contact`, for two
        or, where no two explain, three at least.
        """
        return least_contacts(self.status, self.unknowns)

    @property
    def may_be_more(self) -> bool:
        """Would one contact more explain as well?

        So it is where no equation is left over. Then `candidates` hold all that may be touched if
        there are just so many contacts as `at_least` says, and not of necessity if there are more.
        """
        return self.status == "not_separable" or self.rank is not None

    @property
    def size(self) -> float:
        """Of the force, or of the segment's where the contact's own is not known [N]."""
        force = self.force if self.wrench is None or self.force is not None else self.wrench[:3]
        return 0.0 if force is None else float(np.linalg.norm(force))

    @property
    def line(self) -> tuple[Array, Array] | None:
        """Line of force action in world: its point (3,) [m] nearest to the origin, unit vector.

        None without a wrench or a force.
        """
        if self.wrench is None or not np.linalg.norm(self.wrench[:3]) > 0.0:
            return None
        return line_point(self.wrench), self.wrench[:3] / np.linalg.norm(self.wrench[:3])

    @property
    def moment(self) -> float | None:
        """Of the wrench about its own line [Nm]: zero for one pure force; None without a line."""
        line = self.line
        return None if line is None or self.wrench is None else float(line[1] @ self.wrench[3:])

    @property
    def likely_link(self) -> str | None:
        """The link, or the best candidate's where the place is not certain."""
        if self.link is None and self.candidates:
            return self.candidates[0].link
        return self.link

    @property
    def position_std(self) -> float | None:
        """Square root of the covariance's trace [m]."""
        return None if self.covariance is None else float(np.sqrt(np.trace(self.covariance)))


lazily(Contact, decoders(CONTACT, Candidate))
