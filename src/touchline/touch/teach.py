# SPDX-License-Identifier: Apache-2.0
"""A button by touching it: from the touches of a recording to an entry of `interface`."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.errors import InputError
from touchline.model.description import TaughtTouch, WidgetDescription
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.touch.spot import LEAST_STEP, POSTURE
from touchline.touch.touch import BEFORE

Array = NDArray[np.float64]

RADIUS = 0.02  # m, of a button about a fingertip's place at least
SCATTER = 3.0  # standard deviations of the taught places that a button holds
APART = 0.05  # m; touches farther from their middle do not mean one place
STRONG = 0.5  # of a touch's largest torque; weaker samples are its beginning and end


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
    estimate, _ = pipeline.run(time, q, qd, tau, wrench)
    events = pipeline.events[:touches]
    if not events:
        raise InputError("the recording holds no touch: touch the spot three times, 1 s apart")
    if not robot.sensor_names:
        return _directions(time, np.asarray(q, float), estimate.tau_ext, events, kind)
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


def torque_step(time: Array, tau_ext: Array, event: Event) -> Array:
    """The change of the external torques (n,) [Nm] that a touch brought.

    From the mean over `BEFORE` it was detected to the mean over its strong samples.

    Args:
        time: (N,) [s].
        tau_ext: (N, n) [Nm].
        event: the touch.
    """
    before = (time >= event.detected - BEFORE[0]) & (time < event.detected - BEFORE[1])
    end = time[-1] if event.cleared is None else event.cleared
    during = (time >= event.detected) & (time <= end)
    resting = tau_ext[before].mean(axis=0) if before.any() else np.zeros(tau_ext.shape[1])
    change = tau_ext[during] - resting
    size = np.linalg.norm(np.nan_to_num(change), axis=1)
    return change[size >= STRONG * size.max()].mean(axis=0)


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


def _directions(
    time: Array, q: Array, tau_ext: Array, events: Sequence[Event], kind: str
) -> Lesson:
    taught = []
    for event in events:
        step = torque_step(time, tau_ext, event)
        if np.linalg.norm(np.nan_to_num(step)) < LEAST_STEP:
            continue
        posture = q[np.searchsorted(time, event.detected).clip(0, len(q) - 1)]
        taught.append(
            TaughtTouch(
                tuple(round(float(x), 4) for x in posture),
                tuple(round(float(x), 4) for x in np.nan_to_num(step)),
            )
        )
    if not taught:
        raise InputError(f"the touches change the torques by less than {LEAST_STEP} Nm: too soft")
    units = np.array([touch.step for touch in taught])
    units /= np.linalg.norm(units, axis=1, keepdims=True)
    scatter = float(np.sqrt(np.mean(np.sum((units - units.mean(axis=0)) ** 2, axis=1))))
    note = f"the direction of the joint torques in this posture, within {np.degrees(scatter):.1f}°"
    widget = replace(WidgetDescription(kind), taught=taught)
    return Lesson(widget, len(taught), scatter, note)
