# SPDX-License-Identifier: Apache-2.0
"""From the core's numbers to what they mean."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from touchline.arrays import Array
from touchline.native import core
from touchline.result.kinds import ContactLevel, Status, Zone
from touchline.value import Decode, Field

CONTACT = Field.table(core.CONTACT_FIELDS)
EVENT = Field.table(core.EVENT_FIELDS)

# In the order of the core; no status stands for one that is not worked out: the wrench is all.
STATUSES = tuple(Status("wrench_only" if name == "none" else name) for name in core.STATUSES)
LEVELS = tuple(ContactLevel(name) for name in core.CONTACT_LEVELS)
ZONES = tuple(None if name == "open" else Zone(name) for name in core.ZONES)


@dataclass(frozen=True)
class Names:
    """Whom the indices of a robot's contacts and events mean; each ends with None, for -1.

    Attributes:
        segment: (m + 1) names of the segments.
        joint: (n + 1) of the joints.
        link: of the links with a surface.
        body: of the rigid bodies that these belong to.
    """

    segment: tuple[str | None, ...]
    joint: tuple[str | None, ...]
    link: tuple[str | None, ...]
    body: tuple[str | None, ...]

    @staticmethod
    def of(
        segments: Sequence[str], joints: Sequence[str], links: Sequence[str], bodies: Sequence[str]
    ) -> "Names":
        """Of a robot."""
        return Names((*segments, None), (*joints, None), (*links, None), (*bodies, None))


def names_of(kind: str, names: Names) -> tuple[Any, ...] | None:
    """What the indices of a kind of field mean; None where its numbers are no indices."""
    known = {"level": LEVELS, "status": STATUSES, "zone": ZONES}
    return known.get(kind) or getattr(names, kind, None)


def decoder(field: Field, candidate: Callable[..., Any]) -> Decode:
    """How a field's value follows from the numbers of a row and the `Names` of a robot.

    Args:
        field: of the core.
        candidate: makes a candidate from link, body, probability, position, radius.
    """
    begin, end = field.begin, field.begin + field.size
    match field.kind:
        case "number":
            return lambda row, names: x if (x := row.item(begin)) == x else None
        case "count":
            return lambda row, names: int(x) if (x := row.item(begin)) >= 0.0 else None
        case "flag":
            return lambda row, names: x > 0.0 if (x := row.item(begin)) == x else None
        case "vector" if field.size == 9:
            return lambda row, names: _known(row[begin:end].reshape(3, 3), row.item(begin))
        case "vector":
            return lambda row, names: _known(row[begin:end], row.item(begin))
        case "candidates":
            return lambda row, names: _candidates(row[begin:end], names, candidate)
        case "segment":
            return lambda row, names: names.segment[int(row.item(begin))]
        case "joint":
            return lambda row, names: names.joint[int(row.item(begin))]
        case "link":
            return lambda row, names: names.link[int(row.item(begin))]
        case "body":
            return lambda row, names: names.body[int(row.item(begin))]
        case "level":
            return lambda row, names: LEVELS[int(row.item(begin))]
        case "status":
            return lambda row, names: STATUSES[int(row.item(begin))]
        case "zone":
            return lambda row, names: ZONES[int(row.item(begin))]
    raise TypeError(f"{field.name}: the core has a kind of field that is not known: {field.kind}")


def decoders(table: Sequence[Field], candidate: Callable[..., Any]) -> dict[str, Decode]:
    """Of all fields of a table."""
    return {field.name: decoder(field, candidate) for field in table}


def _known(values: Array, first: float) -> Array | None:
    return values if first == first else None


def _candidates(numbers: Array, names: Names, candidate: Callable[..., Any]) -> tuple[Any, ...]:
    width, found = core.CANDIDATE_WIDTH, []
    for i in range(int(numbers.item(0))):
        part = numbers[1 + width * i : 1 + width * (i + 1)]
        link = int(part.item(0))
        found.append(
            candidate(names.link[link], names.body[link], part.item(1), part[2:5], part.item(5))
        )
    return tuple(found)
