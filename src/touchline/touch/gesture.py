# SPDX-License-Identifier: Apache-2.0
"""Gestures: tap, double tap, hold, push, grab and swipe, from how a touch runs."""

from dataclasses import dataclass, field
from math import erf, sqrt

import numpy as np

from touchline.arrays import Array
from touchline.touch.grip import CLEAR, MISS

SHORTEST = 0.03  # s; no finger presses for less: what is as short is a doubt of the localizer
TAP = 0.3  # s; a shorter press is a tap
HOLD = 1.0  # s; a longer one a hold, told while it lasts
AGAIN = 0.3  # s, from the end of one tap to the beginning of the next in a double tap
NEARBY = 0.05  # m, between the two taps of a double tap
SWIPE = 0.03  # m; a finger that gets farther than this swipes
TIMING = 0.03  # s, 1 sigma: how exactly beginning and end of a press are known
TRAVEL = 0.005  # m, 1 sigma, of the way between two places of one finger
PRESS = 0.5  # of the peak force so far: below it the finger lifts or eases
LIFTED = 0.25  # of the peak force: below it the finger has lifted
EASING = 0.08  # s between both levels: a finger that takes as long presses on with less
GRAB = 0.1  # s; two fingers from opposite sides for as long are a hand
OPPOSITE = -0.5  # cosine between their forces
HAND = 0.2  # m; fingers of one hand are no farther apart
CLAMPED = 0.95  # probability of a hand where the pipeline says so (docs/reaction.md)


@dataclass
class Finger:
    """One press: from when it is felt to when it lifts.

    Attributes:
        event: number of the contact's event.
        begun: [s], `lifted` [s] or None while it presses.
        link: touched link, None where that is not told.
        force: (3,) [N] now, in world; `peak` its largest norm (of joint torques [Nm] where
            no force is known).
        place: (3,) [m] in world now; None where it is not told.
        first, last: (3,) places in the link's frame [m]; None where they are not told.
        collision: whether it was a blow, or too strong for a command.
        doubtful: whether what others do explains it; it is no finger while it is.
        widget: name of the widget it is on.
        grip: by how much a second push misses it [m] (`Grip`); 0 where there is none.
    """

    event: int
    begun: float
    link: str | None = None
    segment: str | None = None
    force: Array | None = None
    peak: float = 0.0
    now: float = 0.0
    place: Array | None = None
    first: Array | None = None
    last: Array | None = None
    far: float = 0.0
    lifted: float | None = None
    collision: bool = False
    clamped: bool = False
    doubtful: bool = False
    widget: str | None = None
    grip: float = 0.0
    told: set[str] = field(default_factory=set)

    def duration(self, time: float) -> float:
        """So far, or in all [s]."""
        return (self.lifted if self.lifted is not None else time) - self.begun

    @property
    def direction(self) -> Array | None:
        """Unit vector (3,) of its way in the link's frame; None if it did not move."""
        if self.first is None or self.last is None:
            return None
        way = self.last - self.first
        length = float(np.linalg.norm(way))
        return way / length if length > 0.0 else None


@dataclass(frozen=True)
class Gesture:
    """What a finger did: `kind`, its `probability`, and when that was decided [s]."""

    kind: str
    finger: Finger
    time: float
    probability: float


class GestureReader:
    """Tells gestures as fingers press, move and lift."""

    def __init__(self) -> None:
        self._waiting: list[tuple[Finger, float]] = []  # taps that may become double taps
        self._held: dict[str | None, float] = {}  # segments that a hand holds; when last touched

    def follow(self, fingers: list[Finger], time: float) -> list[Gesture]:
        """Takes the fingers of one sample, those that lifted just now included."""
        fingers = [finger for finger in fingers if not finger.doubtful]
        found = self._grabs([f for f in fingers if f.lifted is None and not f.collision], time)
        for finger in fingers:
            if not finger.collision and "grab" not in finger.told:
                found += self._one(finger, time)
        return found + self._single_taps(fingers, time)

    def _one(self, finger: Finger, time: float) -> list[Gesture]:
        if finger.told:
            return []
        moved = _beyond(finger.far - SWIPE, TRAVEL)
        length = finger.duration(time)
        if finger.lifted is None:
            if length >= HOLD and moved < 0.5:
                return [_tell("hold", finger, time, (1 - moved) * _beyond(length - TAP, TIMING))]
            return []
        if length < SHORTEST:
            return []
        if moved >= 0.5:
            return [_tell("swipe", finger, time, moved)]
        short = _beyond(TAP - length, TIMING)
        if short < 0.5:
            return [_tell("push", finger, time, (1 - moved) * (1 - short))]
        finger.told.add("tap")
        for i, (earlier, probability) in enumerate(self._waiting):
            if _together(earlier, finger):
                del self._waiting[i]
                gap = finger.begun - (earlier.lifted or earlier.begun)
                sure = probability * short * _beyond(AGAIN - gap, TIMING)
                return [Gesture("double_tap", finger, time, sure)]
        self._waiting.append((finger, (1 - moved) * short))
        return []

    def _single_taps(self, fingers: list[Finger], time: float) -> list[Gesture]:
        found, still = [], []
        for tap, probability in self._waiting:
            more = any(f.lifted is None and not f.told and _together(tap, f) for f in fingers)
            if more or time - (tap.lifted or time) < AGAIN:
                still.append((tap, probability))
            else:
                found.append(Gesture("tap", tap, time, probability))
        self._waiting = still
        return found

    def _grabs(self, fingers: list[Finger], time: float) -> list[Gesture]:
        """A hand around a link: felt as such, called clamped, or two fingers that oppose."""
        for segment in dict.fromkeys(finger.segment for finger in fingers):
            if segment in self._held:
                self._held[segment] = time
        self._held = {name: last for name, last in self._held.items() if time - last < AGAIN}
        found = []
        for segment in dict.fromkeys(finger.segment for finger in fingers):
            hand = [finger for finger in fingers if finger.segment == segment]
            if segment in self._held:
                for finger in hand:  # one that joins belongs to the hand
                    finger.told.add("grab")
                continue
            lasting = max((_opposed_for(a, b, time) for a in hand for b in hand), default=0.0)
            clamped = any(f.clamped for f in hand) and all(near(hand[0], f) for f in hand)
            gripped = max(finger.grip for finger in hand)
            if lasting < GRAB and not gripped and not (clamped and hand[0].duration(time) >= GRAB):
                continue
            for finger in hand[1:]:
                finger.told.add("grab")
            self._held[segment] = time
            self._waiting = [tap for tap in self._waiting if tap[0].segment != segment]
            sure = _beyond(lasting - TIMING, TIMING)
            if gripped:
                sure = max(sure, _beyond(gripped - MISS, CLEAR))
            found.append(_tell("grab", hand[0], time, max(sure, CLAMPED if clamped else 0.0)))
        return found


def _tell(kind: str, finger: Finger, time: float, probability: float) -> Gesture:
    finger.told.add(kind)
    return Gesture(kind, finger, time, probability)


def _beyond(x: float, sigma: float) -> float:
    return 0.5 * (1.0 + erf(x / (sigma * sqrt(2.0))))


def _together(tap: Finger, other: Finger) -> bool:
    """May the other be the second of two taps?"""
    if tap is other or tap.lifted is None or tap.segment != other.segment:
        return False
    if not 0.0 <= other.begun - tap.lifted <= AGAIN:
        return False
    if tap.first is None or other.first is None:
        return True
    return tap.link == other.link and float(np.linalg.norm(tap.first - other.first)) < NEARBY


def near(one: Finger, other: Finger) -> bool:
    """May they belong to one hand?"""
    if one.place is None or other.place is None:
        return True
    return float(np.linalg.norm(one.place - other.place)) < HAND


def _opposed_for(one: Finger, other: Finger, time: float) -> float:
    """How long two fingers have pressed against each other [s]; 0 where they do not."""
    if one.force is None or other.force is None:
        return 0.0
    if not near(one, other):
        return 0.0
    size = float(np.linalg.norm(one.force) * np.linalg.norm(other.force))
    if size == 0.0 or float(one.force @ other.force) >= OPPOSITE * size:
        return 0.0
    return min(one.duration(time), other.duration(time))
