# SPDX-License-Identifier: Apache-2.0
"""A button by touching it: from the touches of a recording to an entry of `interface`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.description import TaughtTouch, WidgetDescription
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.touch.spot import LEAST_STEP, POSTURE
from touchline.touch.touch import TorqueStep, Touch

RADIUS = 0.02  # m, of a button about a fingertip's place at least
SCATTER = 3.0  # standard deviations of the taught places that a button holds
APART = 0.05  # m; touches farther from their middle do not mean one place
STRONG = 0.25  # of the largest torque step; what is weaker was not meant as a touch
NO_TOUCH = "the recording holds no touch: touch the spot three times, 1 s apart"


@dataclass(frozen=True)
class Lesson:
    """What the touches of a recording taught.

    Attributes:
        widget: the entry of `interface`.
        touches: how many touches it comes from.
        scatter: of the places [m], or of the directions of the torque steps [rad]; rms.
        note: what to know of it, one sentence.
    """

    widget: WidgetDescription
    touches: int
    scatter: float
    note: str


def teach(
    robot: Robot,
    time: Array,
    q: Array,
    qd: Array,
    tau: Array,
    wrench: Array,
    kind: str = "button",
    touches: int | None = None,
) -> Lesson:
    """A button or toggle from the touches in a recording.

    Args:
        robot: the robot.
        time: (N,) [s]; `q`, `qd`, `tau` (N, n) and `wrench` (N, k, 6) as for `Pipeline.run`.
        q: see `time`.
        qd: see `time`.
        tau: see `time`.
        wrench: see `time`.
        kind: "button" or "toggle".
        touches: only the first so many; default: all.

    Raises:
        InputError: nothing was touched, or not the same place.
    """
    period = float(np.median(np.diff(time))) if len(time) > 1 else 1e-3
    pipeline = Pipeline(robot, period=period)
    if not robot.sensor_names:
        touch = Touch(robot, pipeline.skin)
        for sample in zip(time, q, qd, tau, wrench, strict=True):
            touch.update(pipeline.update(*sample))
        return lesson_of_steps(list(touch.steps), kind, touches)
    pipeline.run(time, q, qd, tau, wrench)
    return lesson_of_events(pipeline.events[:touches], kind)


def lesson_of_events(events: Sequence[Event], kind: str = "button") -> Lesson:
    """A button or toggle where these touches were located.

    Raises:
        InputError: there are none, or they are not at one place.
    """
    if not events:
        raise InputError(NO_TOUCH)
    located = [e for e in events if e.status == "located" and e.link is not None]
    if len(located) < len(events):
        named = ", ".join(f"{e.detected:.2f} s ({e.status})" for e in events if e not in located)
        raise InputError(f"no place is told for the touches at {named}: press harder or elsewhere")
    return _place(located, kind)


def as_yaml(widget: WidgetDescription, known: WidgetDescription | None = None) -> dict[str, Any]:
    """A taught widget as an entry of `interface`.

    Args:
        widget: as taught.
        known: what stood there; its other settings stay, and touches taught in other postures.
    """
    entry: dict[str, Any] = {"kind": widget.kind}
    for key in ("force", "most"):
        value = getattr(known or widget, key)
        if value != getattr(WidgetDescription, key):
            entry[key] = value
    if widget.link is not None and widget.at is not None:
        return {**entry, "link": widget.link, "at": list(widget.at), "radius": widget.radius}
    here = np.array(widget.taught[0].q)
    others = [
        touch
        for touch in (known.taught if known else ())
        if np.sqrt(np.mean((np.array(touch.q) - here) ** 2)) >= POSTURE
    ]
    taught = [{"q": list(t.q), "step": list(t.step)} for t in (*others, *widget.taught)]
    return {**entry, "taught": taught}


def _place(events: Sequence[Event], kind: str) -> Lesson:
    links = sorted({str(event.link) for event in events})
    if len(links) > 1:
        raise InputError(f"the touches are on different links, {', '.join(links)}: teach one spot")
    places = np.array([event.position_link for event in events])
    middle = places.mean(axis=0)
    apart = np.linalg.norm(places - middle, axis=1)
    if apart.max() > APART:
        worst = 100 * apart.max()
        raise InputError(f"one of the touches is {worst:.0f} cm beside the others: teach one spot")
    scatter = float(np.sqrt(np.mean(apart**2)))
    std = float(np.mean([event.position_std or 0.0 for event in events]))
    radius = max(RADIUS, SCATTER * float(np.hypot(scatter, std)))
    at = tuple(round(float(x), 4) for x in middle)
    widget = WidgetDescription(kind, links[0], at=at, radius=round(radius, 3))
    note = f"a place on {links[0]}, felt within {1e3 * scatter:.1f} mm"
    return Lesson(widget, len(events), scatter, note)


def lesson_of_steps(
    steps: Sequence[TorqueStep], kind: str = "button", touches: int | None = None
) -> Lesson:
    """A button or toggle of the directions in which these touches changed the joint torques.

    Args:
        steps: of `Touch.steps`; much weaker ones are no touches, but what a hand does besides.
        kind: "button" or "toggle".
        touches: only the first so many; default: all.

    Raises:
        InputError: there are none, or they are too soft.
    """
    if not steps:
        raise InputError(NO_TOUCH)
    sizes = [float(np.linalg.norm(np.nan_to_num(step.step))) for step in steps]
    meant = [s for s, size in zip(steps, sizes, strict=True) if size >= STRONG * max(sizes)]
    taught = [
        TaughtTouch(
            tuple(round(float(x), 4) for x in step.q),
            tuple(round(float(x), 4) for x in np.nan_to_num(step.step)),
        )
        for step in meant[:touches]
        if max(sizes) >= LEAST_STEP
    ]
    if not taught:
        raise InputError(f"the touches change the torques by less than {LEAST_STEP} Nm: too soft")
    units = np.array([touch.step for touch in taught])
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    scatter = float(np.sqrt(np.mean(np.sum((units - units.mean(axis=0)) ** 2, axis=1))))
    note = f"the direction of the joint torques in this posture, within {np.degrees(scatter):.1f}°"
    widget = replace(WidgetDescription(kind), taught=taught)
    return Lesson(widget, len(taught), scatter, note)
