# SPDX-License-Identifier: Apache-2.0
"""Which reaction a contact calls for: limits first, then the first rule that holds."""

from dataclasses import dataclass

import numpy as np

from touchline.model.description import ForceLimit, PolicyDescription, PolicyRule
from touchline.result.contact import Contact


@dataclass(frozen=True)
class Choice:
    """A reaction and what called for it.

    Attributes:
        reaction: its name.
        rank: 0 for a limit, 1 + i for rule i, more for none: lower comes first.
        reason: in words.
        lasting: whether it stays until it is reset; otherwise it ends with the contact.
    """

    reaction: str
    rank: int
    reason: str
    lasting: bool


class Policy:
    """The table of a robot's description.

    Args:
        description: the key `policy`.
    """

    def __init__(self, description: PolicyDescription) -> None:
        self.description = description
        self.none = Choice("ignore", 1 + len(description.rules), "no rule", False)

    def choose(self, contact: Contact, duration: float = 0.0) -> Choice:
        """What a contact calls for.

        Rules wait until the contact's level is decided; limits do not.

        Args:
            contact: as it is now.
            duration: since it began [s].
        """
        exceeded = self._exceeded(contact, duration)
        if exceeded is not None:
            return exceeded
        if contact.decided:
            for i, rule in enumerate(self.description.rules):
                if _holds(rule, contact):
                    lasting = contact.level == "collision"
                    return Choice(rule.reaction, 1 + i, f"rule {i + 1}", lasting)
        return self.none

    def _exceeded(self, contact: Contact, duration: float) -> Choice | None:
        limits = self.description.limits
        name = next((n for n in (contact.likely_link, contact.segment) if n in limits), None)
        if name is None:
            return None
        limit, size = limits[name], contact.size
        for kind, most in _due(limit, duration > self.description.transient_time):
            if size > most:
                reason = f"{size:.0f} N on {name}, {kind} limit {most:g} N"
                return Choice(limit.reaction, 0, reason, True)
        return None


def _due(limit: ForceLimit, lasting: bool) -> list[tuple[str, float]]:
    """The limits that count: the transient one always, the quasi-static one after a while."""
    transient = np.inf if limit.transient is None else limit.transient
    due = [("transient", transient)]
    if lasting and limit.quasi_static is not None:
        due.append(("quasi-static", limit.quasi_static))
    return due


def _holds(rule: PolicyRule, contact: Contact) -> bool:
    given = (rule.level, rule.clamped, rule.zone, rule.segment, rule.link)
    known = (contact.level, contact.clamped, contact.zone, contact.segment, contact.likely_link)
    matches = all(want is None or want == have for want, have in zip(given, known, strict=True))
    return matches and (rule.force is None or contact.size >= rule.force)
