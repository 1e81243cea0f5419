# SPDX-License-Identifier: Apache-2.0
"""Where a hand really presses the arm when it pulls at a link."""

from collections.abc import Sequence

from touchline.localizer.skin import Crossing

FINGER = 0.008  # m; between two links that are closer no finger fits
EDGE = 0.03  # m; a link of which a line cuts off less does not bar its way
NEAR = 1e-4  # m

Span = tuple[str, float, float]  # a link, and how far behind the grip the line enters and leaves it


def pressed(crossings: Sequence[Crossing], link: str) -> tuple[str, float] | None:
    """The place on the line of a pull that a finger can reach, behind the grip.

    A finger only pushes, so a pull acts where its line enters the link; where another link is in
    front of that place, it is the other that is pressed.

    Args:
        crossings: of the line with all links, from the grip in the direction of the pull.
        link: that is pulled at.

    Returns:
        The link that is pressed, and how far behind the grip [m]; None if there is no such place.
    """
    spans = sorted(_spans(crossings), key=lambda span: span[1])
    place = None
    for name, enters, leaves in spans:
        if place is None:
            if name == link and enters > -NEAR:
                place = name, max(enters, 0.0)
        elif leaves < place[1] + FINGER and enters - leaves > EDGE:
            place = name, enters
    return place


def _spans(crossings: Sequence[Crossing]) -> list[Span]:
    """The pieces of the line inside of links."""
    found, inside = [], {}
    for crossing in sorted(crossings, key=lambda crossing: crossing.distance):
        if crossing.entry:
            inside[crossing.link] = -crossing.distance
        elif crossing.link in inside:
            found.append((crossing.link, inside.pop(crossing.link), -crossing.distance))
    return found
