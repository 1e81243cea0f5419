# SPDX-License-Identifier: Apache-2.0
"""The arm as an interface: widgets, gestures and strokes from the contacts of a pipeline."""

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.detector.detector import Level
from touchline.localizer.skin import Patch, Skin, in_link
from touchline.model.description import WidgetDescription
from touchline.model.interface_names import GESTURES
from touchline.model.robot import Robot
from touchline.pipeline.result import Result
from touchline.result.contact import Contact
from touchline.suggest import unknown
from touchline.touch.beside import STEPS, WAVER, Beside, Other, Rows
from touchline.touch.gesture import EASING, LIFTED, PRESS, Finger, GestureReader, near
from touchline.touch.grip import Grip
from touchline.touch.soft import DWELL as TORQUE_DWELL
from touchline.touch.soft import SoftTouch
from touchline.touch.spot import AVERAGE as TORQUE_AVERAGE
from touchline.touch.spot import BEFORE, LIKELIER, TorqueSpots
from touchline.touch.stroke import Stroke
from touchline.touch.widget import Widget

DWELL = 0.03  # s; by then 99 % of the collisions are called so (docs/reaction.md), and no command
FULL = 0.5  # of the largest step of a press; a smaller mean is of a force that rises or falls
LATEST = 0.25  # s; a finger that is not on a widget by then only passes over it
SURE = 0.9  # probability of being on a widget, from which it counts
GESTURE_MOST = 60.0  # N; what presses harder means no gesture
AVERAGE = 0.03  # s, over which the place of a press, or its way along a slider, is averaged
STROKE_LEAST = 0.01  # m; a shorter way on a pad is a press, no stroke
BESIDE = 0.1  # s; another contact that began later has to last as long to be more than a doubt
PAUSE = 0.01  # s between two looks at what is before a finger lands, or at whether it is one
KEPT = 1000  # events and strokes that are kept; the oldest go


@dataclass(frozen=True)
class TouchEvent:
    """Something that a person did with the arm.

    Attributes:
        kind: "press", "release", "toggle", "change", "stroke", or a gesture.
        widget: its name; None for a gesture beside all widgets.
        time: at which it was decided [s].
        link: touched link; None where that is not told.
        position: (3,) [m] in the link's frame, or None.
        value: of a toggle (bool), slider or dial (float), or the `Stroke`.
        probability: 0 to 1, that it is so.
        direction: (3,) of a swipe in the link's frame, or None.
        contact: number of the contact's event.
    """

    kind: str
    widget: str | None
    time: float
    link: str | None = None
    position: Array | None = None
    value: Any = None
    probability: float = 1.0
    direction: Array | None = None
    contact: int | None = None

    def as_json(self) -> dict[str, Any]:
        """For JSON: vectors as lists, a stroke as `Stroke.as_json`."""
        value = self.value.as_json() if isinstance(self.value, Stroke) else self.value
        vectors = {
            name: None if vector is None else [float(x) for x in vector]
            for name, vector in (("position", self.position), ("direction", self.direction))
        }
        return asdict(replace(self, value=None, position=None, direction=None)) | {
            "value": value,
            **vectors,
        }


@dataclass(frozen=True)
class TorqueStep:
    """What a finger did to the joint torques of an arm without a force-torque sensor.

    Attributes:
        begun: [s], and `lifted` [s].
        q: (n,) joint positions [rad or m].
        step: (n,) change of the external torque [Nm]; NaN where it is not measured.
    """

    begun: float
    lifted: float
    q: Array
    step: Array


Callback = Callable[[TouchEvent], Any]


@dataclass(frozen=True)
class Touching:
    """A contact as it was before another finger landed.

    Attributes:
        node: that carries it.
        place: (3,) [m] and `force` (3,) [N], in the node's frame.
    """

    node: int
    place: Array
    force: Array


@dataclass(frozen=True)
class Before:
    """What a segment showed before a finger landed.

    Attributes:
        rows: `Rows` (6 + n,).
        touching: the contacts on it, by number of their events.
    """

    rows: Array
    touching: dict[int, Touching]


@dataclass
class Press:
    """A finger, and what a widget needs of it."""

    finger: Finger
    resting: Array  # torques (n,) [Nm] without it
    felt: bool  # whether a force-torque sensor feels it, not joint torques alone
    before: Before | None  # what its segment showed; None where no sensor feels it
    start: Array  # torques (n,) [Nm] before the contact began
    again: bool = False  # whether another finger pressed on the same contact before
    least: float = 0.0  # by how much `resting` differs from them [Nm]
    crest: float = 0.0  # the largest step of this contact [Nm]
    places: deque[tuple[float, Array, float]] = field(default_factory=deque)
    steps: deque[tuple[float, Array]] = field(default_factory=deque)
    ways: deque[tuple[float, float]] = field(default_factory=deque)  # beside others
    full: tuple[Array, Array] | None = None  # joint positions (n,), and the largest mean step (n,)
    widget: Widget | None = None
    trace: list[tuple[float, float, float, float]] = field(default_factory=list)
    value: float | None = None
    turned: float = 0.0
    easing: float | None = None  # since when the force falls
    looked: float = -np.inf  # [s], when it was last asked whether others explain it
    grip: Grip = field(default_factory=Grip)

    def take(self, time: float, q: Array, torque: Array) -> None:
        """A sample while it presses, where joint torques alone tell."""
        self.steps.append((time, torque - self.resting))
        while self.steps[0][0] < time - TORQUE_AVERAGE:
            self.steps.popleft()
        if time - self.finger.begun >= TORQUE_DWELL:
            mean = np.mean([step for _, step in self.steps], axis=0)
            if self.full is None or _size(mean) >= _size(self.full[1]):
                self.full = q, mean

    def after(self, finger: Finger) -> "Press":
        """The next finger on what is still the same contact."""
        return Press(
            finger, self.resting, self.felt, self.before, self.start, True, self.least, self.crest
        )

    def step(self, torque: Array) -> float:
        """By how much the torques differ from those at rest [Nm], where they alone tell.

        Friction holds a part of a touch after its end. So at rest is what was nearest to the
        torques before the contact since the last finger lifted.
        """
        away = _size(torque - self.start)
        if away < self.least:
            self.least, self.resting = away, torque
        size = _size(torque - self.resting)
        self.crest = max(self.crest, size)
        return size


class Touch:
    """Follows a pipeline's results and tells what people do with the arm.

    Args:
        robot: whose `interface` has the widgets.
        skin: its surfaces, if already at hand.

    Attributes:
        events: the last `TouchEvent`s.
        strokes: the last finished ones, as felt; `Stroke.cleaned` is what a `Recognizer` likes.
        steps: what finished presses did to the joint torques, where these alone tell.
        patches: the links' surfaces, by link.
        values: of toggles (bool), sliders and dials (float), by name.
    """

    def __init__(self, robot: Robot, skin: Skin | None = None) -> None:
        self.robot = robot
        skin = skin or Skin(robot)
        self.patches = {patch.link: patch for patch in skin.patches}
        given = robot.description.interface
        self.widgets = {name: make_widget(name, given[name], self.patches) for name in given}
        taught = {name: entry.taught for name, entry in given.items() if entry.taught}
        self._spots = TorqueSpots(taught, skin) if taught else None
        soft = self._spots is not None and not robot.sensor_names
        self._soft = SoftTouch(self._spots) if self._spots is not None and soft else None
        self.values: dict[str, Any] = {
            w.name: False for w in self.widgets.values() if w.kind == "toggle"
        }
        self.events: deque[TouchEvent] = deque(maxlen=KEPT)
        self.strokes: deque[Stroke] = deque(maxlen=KEPT)
        self.steps: deque[TorqueStep] = deque(maxlen=KEPT)
        self._callbacks: dict[str, list[Callback]] = {}
        self._gestures = GestureReader()
        self._presses: dict[int, Press] = {}
        self._rest: deque[tuple[float, Array]] = deque()
        self._paths = {
            widget.name: _path(self.patches[widget.link], widget)
            for widget in self.widgets.values()
            if widget.kind == "slider" and widget.link in self.patches
        }
        self._beside = {name: Beside(robot, name) for name in robot.sensor_names}
        self._past: deque[tuple[float, Result]] = deque()

    def on(self, name: str, callback: Callback | None = None) -> Any:
        """Calls `callback(event)` for a widget or a gesture; without one a decorator.

        Raises:
            ValueError: there is no such widget or gesture.
        """
        known = (*self.widgets, *GESTURES)
        if name not in known:
            raise ValueError(unknown(name, "widget or gesture", known))
        if callback is None:
            return lambda function: self.on(name, function) or function
        self._callbacks.setdefault(name, []).append(callback)
        return None

    def update(self, result: Result) -> list[TouchEvent]:
        """Takes the result of one `Pipeline.update`; what was decided with it.

        Callbacks are called before it returns, in the order of the events.
        """
        time, q = result.time, np.asarray(result.q, float)
        found: list[TouchEvent] = []
        torque = result.estimate.tau_ext
        contacts = result.contacts
        resting = self._soft is None or self._soft.resting is None
        if resting and not contacts and not self._presses:
            self._rest.append((time, torque))
            while self._rest[0][0] < time - BEFORE[0]:
                self._rest.popleft()
        if self._beside and (not self._past or time - self._past[-1][0] >= PAUSE):
            self._past.append((time, result))
            while self._past[0][0] < time - BEFORE[0]:
                self._past.popleft()
        poses = self.robot.poses(q) if contacts else None
        seen = set()
        for contact in contacts:
            seen.add(contact.event)
            found += self._follow(contact, result, q, torque, poses)
        for number in [n for n in self._presses if n not in seen]:
            found += self._lift(self._presses[number], time)
        found += self._softly(time, q, torque, bool(contacts))
        fingers = [press.finger for press in self._presses.values()]
        found += [self._gesture_event(g) for g in self._gestures.follow(fingers, time)]
        for number in [n for n, p in self._presses.items() if p.finger.lifted is not None]:
            if number not in seen:
                del self._presses[number]
        for event in found:
            self.events.append(event)
            for callback in (
                *self._callbacks.get(event.widget or "", ()),
                *self._callbacks.get(event.kind, ()),
            ):
                callback(event)
        return found

    @property
    def presses(self) -> tuple[Press, ...]:
        """The fingers that press now, with the widgets that they use."""
        return tuple(p for p in self._presses.values() if p.finger.lifted is None)

    def widget_at(self, link: str | None, position_link: Array | None) -> str | None:
        """Name of the widget at a place (3,) [m] in a link's frame, or None."""
        if link is None or position_link is None:
            return None
        inside = [
            (widget.read(position_link).beyond, widget.name)
            for widget in self.widgets.values()
            if widget.link == link and not widget.given.taught
        ]
        return min(inside)[1] if inside and min(inside)[0] <= 0.0 else None

    @property
    def spots(self) -> TorqueSpots | None:
        """What tells spots that were taught by joint torques; None where there are none."""
        return self._spots

    def _softly(self, time: float, q: Array, torque: Array, felt: bool) -> list[TouchEvent]:
        """What touches do that the detector does not feel, or no longer."""
        if self._soft is None:
            return []
        if any(press.widget is not None for press in self._presses.values()):
            self._soft.leave()
        told = self._soft.follow(time, q, torque, felt)
        if told is None:
            return []
        kind, name, probability = told
        found = [TouchEvent(kind, name, time, probability=probability)]
        if kind == "press" and self.widgets[name].kind == "toggle":
            self.values[name] = not self.values[name]
            found.append(replace(found[0], kind="toggle", value=self.values[name]))
        return found

    def _follow(self, contact: Contact, result: Result, q, torque, poses) -> list[TouchEvent]:
        time = result.time
        press = self._presses.get(contact.event)
        if press is None:
            press = self._begin(contact, time, torque)
        finger = press.finger
        beside = self._along(press, result, poses)
        if beside is not None:
            size = float(np.linalg.norm(beside[1]))
        elif contact.wrench is not None:
            size = contact.size
        else:
            size = press.step(torque)
        if finger.lifted is not None:
            if size < (PRESS * finger.peak if press.felt else LIFTED * press.crest):
                return []  # it rests on the surface
            press = self._begin(contact, time, torque, press)
            finger = press.finger
        finger.now = size
        finger.peak = max(finger.peak, size)
        finger.collision |= self._is_blow(press, contact, result)
        finger.clamped |= bool(contact.clamped)
        finger.force = contact.force
        if size < PRESS * finger.peak:
            return self._ease(press, time)
        press.easing = None
        if not press.felt:
            press.take(time, q, torque)
        self._place(press, contact, time, poses)
        if press.widget is not None:
            return self._use(press, time, None if beside is None else beside[0])
        self._doubt(press, result, poses)
        return [] if finger.doubtful else self._choose(press, contact, time, q)

    def _is_blow(self, press: Press, contact: Contact, result: Result) -> bool:
        """Is it a collision, or too strong for a command?

        A contact that was one stays one while it lasts; a finger that presses on it anew does not.
        """
        if press.again:
            segment = self.robot.segment_names.index(contact.segment)
            if result.detection.levels[segment] == Level.COLLISION:
                return True
        elif contact.level == "collision":
            return True
        return press.felt and press.finger.now > GESTURE_MOST

    def _ease(self, press: Press, time: float) -> list[TouchEvent]:
        """The force falls: the finger lifts, or presses on with less."""
        finger = press.finger
        if press.easing is None:
            press.easing = time
        if press.felt and finger.now < LIFTED * finger.peak:
            return self._lift(press, time)
        if time - press.easing >= EASING:
            if not press.felt:  # friction holds a part of the torques: they do not return to zero
                return self._lift(press, time)
            finger.peak, press.easing = finger.now, None
        return []

    def _begin(
        self, contact: Contact, time: float, torque: Array, earlier: Press | None = None
    ) -> Press:
        """A finger that lands; `earlier` on what is still the same contact."""
        finger = Finger(contact.event, time, segment=contact.segment)
        if earlier is not None:
            press = earlier.after(finger)
        else:
            last = self._rest[-1][0] if self._rest else time
            early = [t for at, t in self._rest if at <= last - BEFORE[1]]
            resting = np.mean(early, axis=0) if early else np.zeros_like(torque)
            felt = contact.wrench is not None
            before = self._before(contact, time) if felt else None
            if not felt and self._soft is not None and self._soft.resting is not None:
                resting = self._soft.resting
            press = Press(finger, resting, felt, before, resting)
            if self._soft is not None and self._soft.name is not None:
                press.widget = self.widgets[self._soft.name]  # a soft touch that grew
                finger.widget = press.widget.name
        self._presses[contact.event] = press
        return press

    def _before(self, contact: Contact, time: float) -> Before | None:
        """What the segment of a contact showed before it; None without its sensor."""
        early = [past for at, past in self._past if at <= time - BEFORE[1]]
        if not early or contact.segment not in self._beside:
            return None
        rows = np.mean([self._rows(past, contact.segment) for past in early], axis=0)
        poses, touching = self.robot.poses(np.asarray(early[-1].q, float)), {}
        for other in early[-1].contacts:
            if other.segment == contact.segment and other.event != contact.event:
                found = self._touching(other, poses)
                if found is not None:
                    touching[other.event] = found
        return Before(rows, touching)

    def _touching(self, contact: Contact, poses) -> Touching | None:
        if contact.link not in self.patches or contact.position is None:
            return None
        node = self.patches[contact.link].node
        R, p = poses[node][:3, :3], poses[node][:3, 3]
        force = np.zeros(3) if contact.force is None else contact.force
        return Touching(node, (contact.position - p) @ R, force @ R)

    def _others(self, press: Press, result: Result, poses) -> list[Other]:
        """What else touches a finger's segment, or did when it landed."""
        finger, before = press.finger, press.before
        assert before is not None
        now: dict[int, Touching] = {}
        for contact in result.contacts:
            other = self._presses.get(contact.event)
            if other is None or other is press or contact.segment != finger.segment:
                continue
            newer = other.finger.begun > finger.begun
            if newer and other.finger.duration(result.time) < BESIDE:
                continue
            found = self._touching(contact, poses)
            if found is not None:
                now[contact.event] = found
        found = []
        for event, then in before.touching.items():
            force = now[event].force if event in now else np.zeros(3)
            spread = np.hypot(WAVER * _size(then.force), _size(force - then.force))
            found.append(Other(then.node, then.place, max(float(spread), WAVER)))
        for event, other in now.items():
            if event not in before.touching:
                found.append(Other(other.node, other.place, max(_size(other.force), 1.0)))
        return found

    def _change(self, press: Press, result: Result) -> Array:
        """What its segment shows (6 + n,) less what it showed before a finger."""
        assert press.before is not None
        segment = press.finger.segment
        alone = all(contact.segment == segment for contact in result.contacts)
        return self._rows(result, segment, alone) - press.before.rows

    def _doubt(self, press: Press, result: Result, poses) -> None:
        """Is there a finger, or does what others do explain all that changed?"""
        finger, time = press.finger, result.time
        if press.before is None or not press.places or time - press.looked < PAUSE:
            return
        if not DWELL / 2 <= time - finger.begun <= LATEST or finger.link not in self.patches:
            return
        press.looked, others = time, self._others(press, result, poses)
        if not others:
            finger.doubtful = False
            return
        patch = self.patches[finger.link]
        T = patch.T_node_link
        point = T[:3, :3] @ press.places[-1][1] + T[:3, 3]
        change = self._change(press, result)
        beside = self._beside[str(finger.segment)]
        force = beside.force_at(poses, patch.node, point, change, others)
        claimed = np.zeros(3) if finger.force is None else finger.force
        finger.doubtful = _size(force - claimed) > PRESS * finger.now

    def _apart(self, press: Press, time: float) -> bool:
        """Does another hand touch the segment elsewhere, or did it when this finger landed?"""
        if press.before is not None and press.before.touching:
            return True
        finger = press.finger
        return any(
            other.segment == finger.segment
            and other.lifted is None
            and other.duration(time) >= BESIDE
            and not near(finger, other)
            for other in (p.finger for p in self._presses.values() if p is not press)
        )

    def _place(self, press: Press, contact: Contact, time: float, poses) -> None:
        finger = press.finger
        if contact.position is None or contact.link not in self.patches or poses is None:
            return
        patch = self.patches[contact.link]
        point = in_link(patch, poses[patch.node], contact.position)
        if contact.link != finger.link:
            press.places.clear()
            press.grip = Grip()
            finger.link, finger.first, finger.far = contact.link, None, 0.0
        finger.place = contact.position
        press.places.append((time, point, contact.position_std or 0.0))
        if contact.wrench is not None and press.grip.due(time):
            if self._apart(press, time):
                press.grip = Grip()  # what changes on the segment may be the other's doing
            wrench = _in(poses[patch.node] @ patch.T_node_link, contact.wrench)
            finger.grip = max(finger.grip, press.grip.follow(time, wrench, point))
        while press.places[0][0] < time - AVERAGE:
            press.places.popleft()
        if time - finger.begun >= DWELL / 2:
            here: Array = np.mean([place for _, place, _ in press.places], axis=0)
            finger.last = here
            if finger.first is None:
                finger.first = here
            finger.far = max(finger.far, float(np.linalg.norm(here - finger.first)))

    def _choose(self, press: Press, contact: Contact, time, q) -> list[TouchEvent]:
        finger = press.finger
        age = time - finger.begun
        if finger.collision or age < DWELL or (press.felt and age > LATEST):
            return []
        widget, probability = self._on_widget(press, q, time)
        if widget is None:
            return []
        # Torques alone tell no force in N of a spot without a place: a blow ends it, no limit does.
        if contact.force is not None and not widget.given.taught:
            size = finger.now if press.felt else _size(contact.force)
            if not widget.force <= size <= widget.most:
                return []
        press.widget, finger.widget = widget, widget.name
        found = [self._event("press", press, time, probability=probability)]
        if widget.kind == "toggle":
            self.values[widget.name] = not self.values[widget.name]
            value = self.values[widget.name]
            found.append(self._event("toggle", press, time, value, probability))
        return found + self._use(press, time)

    def _on_widget(self, press: Press, q: Array, time: float) -> tuple[Widget | None, float]:
        finger = press.finger
        if press.places and finger.link is not None:
            point = np.mean([place for _, place, _ in press.places], axis=0)
            std = float(np.mean([s for _, _, s in press.places]))
            chances = [
                (widget.probability(point, std), -widget.read(point).beyond, widget)
                for widget in self.widgets.values()
                if widget.link == finger.link and not widget.given.taught
            ]
            if chances:
                best = max(chances, key=lambda chance: chance[:2])
                return (best[2], best[0]) if best[0] >= SURE else (None, 0.0)
        if self._spots is None or press.full is None or time - press.looked < PAUSE:
            return None, 0.0
        press.looked, step = time, press.full[1]
        if _size(step) < FULL * finger.peak:
            return None, 0.0
        name, probability = self._spots.read(q, step)[0]
        if name is None or probability < LIKELIER:
            return None, 0.0
        return self.widgets[name], probability

    def _along(self, press: Press, result: Result, poses) -> tuple[float, Array] | None:
        """Way and force (3,) of a slider's finger where others touch its segment, too.

        The way is a mean, as a place is: between two hands one instant tells little.
        """
        widget, finger = press.widget, press.finger
        if widget is None or widget.name not in self._paths or press.before is None:
            return None
        others = self._others(press, result, poses)
        if not others:
            return None
        node, path = self._paths[widget.name]
        beside = self._beside[str(finger.segment)]
        way, force = beside.along(poses, node, path, self._change(press, result), others)
        press.ways.append((result.time, way))
        while press.ways[0][0] < result.time - AVERAGE:
            press.ways.popleft()
        return float(np.mean([way for _, way in press.ways])), force

    def _rows(self, result: Result, segment: str | None, alone: bool = True) -> Array:
        """What a segment's sensor and the joints show (6 + n,); joints only if all is on it."""
        torque = result.estimate.tau_ext
        wrench = np.full(6, np.nan)
        if segment in self.robot.segment_names:
            wrench = result.estimate.segment_wrench[self.robot.segment_names.index(segment)]
        return Rows(wrench, torque if alone else np.full_like(torque, np.nan)).values()

    def _use(self, press: Press, time: float, way: float | None = None) -> list[TouchEvent]:
        """What a pressed slider, dial or pad reports."""
        widget, finger = press.widget, press.finger
        if widget is None or finger.last is None or not press.places:
            return []
        if finger.collision or (press.felt and finger.now > widget.most):
            return self._lift(press, time)
        reading = widget.read(press.places[-1][1])
        if widget.kind == "pad" and isinstance(reading.value, tuple):
            press.trace.append((time, *reading.value, finger.now))
            return []
        mean = widget.read(finger.last).value if way is None else way
        if widget.kind == "slider" and isinstance(mean, float):
            value = widget.scaled(mean)
        elif widget.kind == "dial" and isinstance(mean, float):
            before = mean if press.value is None else press.value
            press.turned += (mean - before + np.pi) % (2 * np.pi) - np.pi
            press.value = mean
            value = press.turned
        else:
            return []
        if self.values.get(widget.name) == value:
            return []
        self.values[widget.name] = value
        return [self._event("change", press, time, value)]

    def _lift(self, press: Press, time: float) -> list[TouchEvent]:
        finger, widget = press.finger, press.widget
        if finger.lifted is not None:
            return []
        finger.lifted = time if press.easing is None else press.easing
        press.least = np.inf
        if press.full is not None:
            self.steps.append(TorqueStep(finger.begun, finger.lifted, *press.full))
        if widget is None:
            return []
        found = [self._event("release", press, time, self.values.get(widget.name))]
        if widget.kind == "pad" and len(press.trace) > 2 and not finger.collision:
            trace = np.array(press.trace)
            stroke = Stroke(widget.name, widget.link, trace[:, :3], trace[:, 3])
            if stroke.cleaned().length >= STROKE_LEAST:
                self.strokes.append(stroke)
                found.append(self._event("stroke", press, time, stroke))
        return found

    def _event(self, kind, press: Press, time, value=None, probability=1.0) -> TouchEvent:
        finger = press.finger
        name = press.widget.name if press.widget is not None else None
        return TouchEvent(
            kind, name, time, finger.link, finger.last, value, probability, None, finger.event
        )

    def _gesture_event(self, gesture) -> TouchEvent:
        finger = gesture.finger
        return TouchEvent(
            gesture.kind,
            finger.widget,
            gesture.time,
            finger.link,
            finger.last,
            None,
            gesture.probability,
            finger.direction if gesture.kind == "swipe" else None,
            finger.event,
        )


def make_widget(name: str, given: WidgetDescription, patches: Mapping[str, Patch]) -> Widget:
    """A widget on the surfaces of a robot, by link; a pad's normal follows from the surface.

    Raises:
        InputError: its directions do not fit each other.
    """
    normal = None
    if given.kind == "pad" and given.normal is None and given.link and given.link in patches:
        normal = mean_normal(patches[given.link], np.array(given.at), max(given.size or (0.0,)) / 2)
    return Widget(name, given, normal)


def _path(patch: Patch, widget: Widget) -> tuple[int, Array]:
    """A slider's path: the node that carries it, and points (STEPS + 1, 3) [m] in its frame."""
    T = patch.T_node_link
    points = np.array([widget.point_at(i / STEPS) for i in range(STEPS + 1)])
    return patch.node, points @ T[:3, :3].T + T[:3, 3]


def mean_normal(patch, at: Array, radius: float) -> Array:
    """The outward normal (3,) of a link's surface around a place, in the link's frame.

    Mean over the triangles within `radius` [m] that look the same way as the nearest one.
    """
    surface = patch.surface
    middles = surface.vertices[surface.faces].mean(axis=1)
    distance = np.linalg.norm(middles - at, axis=1)
    nearest = surface.normals[int(np.argmin(distance))]
    near = (distance < radius) & (surface.normals @ nearest > 0.5)
    total = (surface.normals[near] * surface.areas[near, None]).sum(axis=0)
    length = float(np.linalg.norm(total))
    return total / length if length > 0.0 else nearest


def _size(torque: Array) -> float:
    return float(np.linalg.norm(np.nan_to_num(torque)))


def _in(frame: Array, wrench: Array) -> Array:
    """A wrench (6,) in world about its origin, in the axes and about the origin of a frame."""
    R, p = frame[:3, :3], frame[:3, 3]
    force = wrench[:3]
    return np.concatenate([force @ R, (wrench[3:] - np.cross(p, force)) @ R])
