# SPDX-License-Identifier: Apache-2.0
"""Do the widgets of `interface` have what their kind needs, on links that exist?"""

from collections.abc import Iterator

from touchline.model.description import WidgetDescription
from touchline.model.entries import RobotFile
from touchline.model.mechanism import Mechanism
from touchline.model.names import Problem
from touchline.suggest import unknown

NEEDS = {
    "button": ("at", "radius"),
    "toggle": ("at", "radius"),
    "slider": ("link", "path"),
    "dial": ("link", "at", "normal", "radius"),
    "pad": ("link", "at", "up", "size"),
}
GESTURES = ("tap", "double_tap", "hold", "push", "grab", "swipe")


def check_interface(
    file: RobotFile, mechanism: Mechanism | None, joints: int | None
) -> Iterator[Problem]:
    """Yield what is wrong with `interface`; with links only where there is a mechanism.

    Args:
        file: the file as it stands.
        mechanism: the model.
        joints: number of observed joints; None if it is not known.
    """
    for name, widget in file.interface.items():
        where = f"interface.{name}"
        if name in GESTURES:
            yield where, f"'{name}' is the name of a gesture; gestures: {', '.join(GESTURES)}"
        if widget is None or widget.kind is None:
            continue
        if mechanism is not None and widget.link is not None and widget.link not in mechanism.links:
            yield f"{where}.link", unknown(widget.link, "link", mechanism.links)
        yield from _shape(where, widget)
        for index, touch in enumerate(widget.taught):
            for key in ("q", "step"):
                count = len(getattr(touch, key)) if touch is not None else joints
                if joints is not None and count != joints:
                    what = f"has {count} values; allowed: one for each of the {joints} joints"
                    yield f"{where}.taught[{index}].{key}", what


def _shape(where: str, widget: WidgetDescription) -> Iterator[Problem]:
    missing = [key for key in NEEDS[widget.kind] if not getattr(widget, key)]
    spot = widget.kind in ("button", "toggle")
    if spot and len(missing) == 2 and (widget.link or widget.taught):
        missing = []  # the whole link, or a spot that torques tell
    elif spot and not widget.link:
        missing = ["link", *missing]
    if missing:
        yield where, f"a {widget.kind} needs {' and '.join(missing)}"
    if widget.kind == "slider" and len(widget.path) == 1:
        yield f"{where}.path", "has 1 point; allowed: 2 or more"
    for key in ("normal", "up"):
        direction = getattr(widget, key)
        if direction is not None and not any(direction):
            yield f"{where}.{key}", "is the zero vector; it has to give a direction"
    if widget.most <= widget.force:
        yield f"{where}.most", f"{widget.most:g} is not above force, {widget.force:g}"
