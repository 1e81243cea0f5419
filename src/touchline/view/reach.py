# SPDX-License-Identifier: Apache-2.0
"""Where a hand really presses the arm when it pulls at a link."""

from collections.abc import Sequence

from touchline.contact.skin import Crossing

FINGER = 0.012  # m; between two links that are closer no finger fits
NEAR = 1e-4  # m


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
    backwards = sorted(crossings, key=lambda crossing: -crossing.distance)
    inside: set[str] = set()
    passed = False
    for i, crossing in enumerate(backwards):
        if not crossing.entry:
            inside.add(crossing.link)
            continue
        inside.discard(crossing.link)
        passed = passed or (crossing.link == link and crossing.distance < NEAR)
        room = crossing.distance - backwards[i + 1].distance if i + 1 < len(backwards) else FINGER
        if passed and not inside and room >= FINGER:
            return crossing.link, max(-crossing.distance, 0.0)
    return None
