# SPDX-License-Identifier: Apache-2.0
"""What other viewers show of results: the arm, contacts, curves and events, thinned."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array, Index
from touchline.model.description import AXES
from touchline.model.surface import Surface, link_surface
from touchline.result.contact import Contact
from touchline.result.event import Event
from touchline.view.replay import Replay

Colour = tuple[int, int, int]

RATE = 30.0  # Hz, of what is seen in space: as screens do
CURVE_RATE = 100.0  # Hz, of curves: as of the postures
METRES_PER_NEWTON = 0.008  # of arrows: 25 N are as long as a hand
SHELL, TOUCHED, HIT = (225, 227, 230), (240, 150, 40), (230, 60, 50)
EPOCH = 1e6  # s; stamps beyond it are dates


@dataclass(frozen=True)
class Moment:
    """The arm at a time.

    Attributes:
        time: [s].
        poses: T_world_link (4, 4) by link.
        contacts: those that last.
    """

    time: float
    poses: dict[str, Array]
    contacts: list[Contact]


def surfaces(replay: Replay) -> dict[str, Surface]:
    """The visible shape of each link that has one, in the frame of the link."""
    links = replay.robot.mechanism.links.values()
    found = {link.name: link_surface(link, "visual") for link in links}
    return {name: surface for name, surface in found.items() if surface is not None}


def moments(replay: Replay) -> Iterator[Moment]:
    """The arm from the first to the last posture, RATE times a second at most."""
    for time in _thinned(replay.times, RATE)[0]:
        poses = replay.robot.T_world_links(replay.posture(float(time)))
        yield Moment(float(time), poses, replay.contacts(float(time)))


def curves(replay: Replay) -> Iterator[tuple[Array, dict[str, Array]]]:
    """Parts of the estimates: times (N,) [s] and values (N,) by signal, NaN where unknown.

    They are single samples, CURVE_RATE of them a second at most: a peak between them is not seen.
    """
    last = -np.inf
    for group in range(replay.estimates.groups):
        time, rows = _thinned(replay.estimates.values("time", group), CURVE_RATE, last)
        if len(time):
            last = float(time[-1])
            yield (
                time,
                {name: replay.estimates.values(name, group)[rows] for name in replay.signals},
            )


def _thinned(time: Array, rate: float, last: float = -np.inf) -> tuple[Array, Index]:
    """The first time of each slot of 1 / rate after `last`, and their rows; times increase."""
    usable = np.flatnonzero(np.isfinite(time) & (time > last))
    usable = usable[time[usable] >= np.maximum.accumulate(time[usable])]
    before = np.floor(last * rate) if np.isfinite(last) else -np.inf
    slot = np.floor(time[usable] * rate)
    rows = usable[slot > np.concatenate([[before], slot[:-1]])]
    return time[rows], rows


def arrow(contact: Contact) -> tuple[Array, Array] | None:
    """Tail (3,) and vector (3,) [m] in world of a contact's force; its tip is where it acts.

    None where no point or no force is known.
    """
    if contact.position is None or contact.force is None:
        return None
    vector = METRES_PER_NEWTON * np.asarray(contact.force)
    return np.asarray(contact.position) - vector, vector


def colour(contact: Contact) -> Colour:
    """Of a contact on the page, by its level."""
    return HIT if contact.level == "collision" else TOUCHED


def told(events: list[Event]) -> list[tuple[float, str, dict[str, Any]]]:
    """When events began and ended [s], in words, and as in `events.json`; in the order of time."""
    lines = []
    for event in events:
        where = event.link or event.segment
        facts = event.as_json()
        lines.append((event.detected, f"{event.level} {event.id} on {where}", facts))
        if event.cleared is not None:
            lines.append((event.cleared, f"{event.level} {event.id} ended", facts))
    return sorted(lines, key=lambda line: line[0])


def wrenches(replay: Replay) -> dict[str, list[str]]:
    """The six columns of each wrench in the estimates, by what comes before their `.fx`."""
    names = [signal.removesuffix(".fx") for signal in replay.signals if signal.endswith(".fx")]
    return {name: [f"{name}.{axis}" for axis in AXES] for name in names}
