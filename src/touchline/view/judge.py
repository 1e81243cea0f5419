# SPDX-License-Identifier: Apache-2.0
"""What was felt beside what was done: errors and delays, segment by segment."""

from dataclasses import dataclass, field

import numpy as np

from touchline.arrays import Array, Mask
from touchline.model.robot import Robot
from touchline.result.contact import Contact
from touchline.simulation.hands import Hand
from touchline.simulation.truth import Truth
from touchline.view.methods import Felt


@dataclass(frozen=True)
class Touched:
    """One true contact at one instant: `point` (3,) [m], `force` (3,) [N], world axes."""

    link: str
    point: Array
    force: Array


@dataclass(frozen=True)
class Verdict:
    """One segment; what there is nothing to say about is None.

    Attributes:
        segment: name.
        level: 0, 1 contact, 2 collision.
        contact: as felt.
        true: contacts on the segment.
        position_error: between the point that was felt and that of the only contact [m].
        force_error: between the force that was felt and the sum of all [N].
        delay: from the onset of a push to its detection, of the last one [s].
    """

    segment: str
    level: int
    contact: Contact | None
    true: tuple[Touched, ...]
    position_error: float | None
    force_error: float | None
    delay: float | None


@dataclass
class _Onset:
    began: float | None = None
    delay: float | None = None
    waiting: bool = field(default=False)


class Judge:
    """Compares; remembers the delays.

    Args:
        robot: whose links belong to the segments that the observer tells apart.
    """

    def __init__(self, robot: Robot) -> None:
        self._segment = {link: body.segment for body in robot.bodies for link in body.links}
        self._onsets: dict[str, _Onset] = {}

    def judge(self, felt: Felt, truth: Truth, hands: list[Hand]) -> list[Verdict]:
        """One verdict for each segment that the method tells apart.

        Args:
            felt: by the method.
            truth: of the same samples.
            hands: that are on the arm.
        """
        true = touched(truth)
        verdicts = []
        for g, segment in enumerate(felt.segments):
            own = tuple(t for t in true if segment == "root" or self._segment[t.link] == segment)
            began = [
                hand.began
                for hand in hands
                if hand.began is not None
                and (segment == "root" or self._segment[hand.pressed] == segment)
            ]
            delay = self._delay(segment, felt.time, felt.levels[:, g] > 0, began)
            contact = next((c for c in felt.contacts if c.segment == segment), None)
            verdicts.append(
                Verdict(
                    segment,
                    int(felt.levels[-1, g]),
                    contact,
                    own,
                    _position_error(contact, own),
                    _force_error(contact, own),
                    delay,
                )
            )
        return verdicts

    def _delay(self, segment: str, time: Array, active: Mask, began: list[float]) -> float | None:
        """Of the first hand on a segment that nothing touched; later ones go unnoticed."""
        onset = self._onsets.setdefault(segment, _Onset())
        if not began:
            onset.began, onset.waiting = None, False
        elif onset.began is None:
            onset.began, onset.waiting = min(began), True
        if onset.waiting and onset.began is not None:
            fired = np.flatnonzero(active & (time >= onset.began))
            if len(fired):
                onset.delay, onset.waiting = float(time[fired[0]]) - onset.began, False
        return onset.delay


def touched(truth: Truth) -> list[Touched]:
    """The contacts at the last sample."""
    last = truth.link[-1]
    return [
        Touched(truth.links[last[slot]], truth.point[-1, slot], truth.force[-1, slot])
        for slot in np.flatnonzero(last >= 0)
    ]


def _position_error(contact: Contact | None, own: tuple[Touched, ...]) -> float | None:
    if contact is None or contact.position is None or len(own) != 1:
        return None
    return float(np.linalg.norm(contact.position - own[0].point))


def _force_error(contact: Contact | None, own: tuple[Touched, ...]) -> float | None:
    if contact is None or contact.force is None:
        return None
    total = np.sum([t.force for t in own], axis=0) if own else np.zeros(3)
    return float(np.linalg.norm(contact.force - total))
