# SPDX-License-Identifier: Apache-2.0
"""One line for everything that happens while a robot runs."""

from touchline.live.connection import Notice
from touchline.live.session import Session
from touchline.report.facts import event_place
from touchline.result.event import Event
from touchline.touch.stroke import Stroke
from touchline.touch.touch import TouchEvent

WITHHELD = {"stale", "invalid", "not received"}


def began_line(event: Event, origin: float) -> str:
    """An event that has begun."""
    return (
        f"{event.detected - origin:10.3f} s  {event.level} {event.id} {_where(event)}{_size(event)}"
    )


def ended_line(event: Event, origin: float) -> str:
    """An event that is over."""
    assert event.cleared is not None
    lasted = event.cleared - event.detected
    return (
        f"{event.cleared - origin:10.3f} s  {event.level} {event.id} over after {lasted:.2f} s: "
        f"{_where(event)}{_size(event)}"
    )


def touch_line(event: TouchEvent, origin: float) -> str:
    """Something that a person did with the arm."""
    value = ""
    if isinstance(event.value, Stroke):
        value = f" of {100 * event.value.length:.1f} cm"
    elif event.value is not None:
        value = f": {event.value:.3g}" if isinstance(event.value, float) else f": {event.value}"
    where = event.widget or event.link or "the arm"
    return f"{event.time - origin:10.3f} s  {where}: {event.kind}{value}"


def notice_line(notice: Notice, session: Session) -> str:
    """Something that happened to the link."""
    first = session.connection.streams[0].name
    withheld = notice.stream == first and notice.state in WITHHELD
    return f"{'':10}    {notice.text}{'; estimates are withheld' if withheld else ''}"


def summary_lines(session: Session, events: int, now: float) -> list[str]:
    """What there is to say at the end."""
    lines = [f"{session.samples} samples, {events} events"]
    return lines + [f"  {stream.describe(now)}" for stream in session.connection.streams]


def _where(event: Event) -> str:
    place = event_place(event)
    if event.link is not None:
        return f"on {place}"
    perhaps = f", perhaps on {event.candidates[0].link}" if event.candidates else ""
    return f"on segment {event.segment}{perhaps}: {place}"


def _size(event: Event) -> str:
    if event.force_peak is not None:
        force = f", up to {event.force_peak:.1f} N"
        if event.position is not None and event.link is not None:
            x, y, z = event.position
            force += f" at ({x:.3f}, {y:.3f}, {z:.3f}) m"
        return force
    if event.torque_peak is not None and event.joint is not None:
        return f", up to {event.torque_peak:.2f} Nm on {event.joint}"
    return ""
