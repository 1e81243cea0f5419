# SPDX-License-Identifier: Apache-2.0
"""The live page with an interface on the arm: buttons, a slider and a pad to write on."""

from collections import deque
from dataclasses import replace
from html import escape

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.simulation.setup import read_setup
from touchline.touch.plain import plain_digits
from touchline.touch.recognizer import Recognizer
from touchline.touch.stroke import Stroke
from touchline.touch.touch import LATEST, Touch, TouchEvent
from touchline.view.arm import LiveArm
from touchline.view.finger import Finger
from touchline.view.grasp import let_touch
from touchline.view.judge import Touched
from touchline.view.live import LivePage
from touchline.view.methods import Felt
from touchline.view.path import TaughtPath
from touchline.view.server import PageServer
from touchline.view.widgets import WidgetScene

PART = 10  # samples after which a finger is moved on
FORCE, STIFFNESS = 8.0, 100.0  # N, %; the page begins with
GUIDED = 20.0  # Nm s/rad: how fast the standing arm gives way to a finger beside the widgets
TOLD = 8  # last events that the page lists
SPEEDS = (0.1, 0.8)  # rad/s at the ends of the slider
ADVICE = (
    "**Click** on a widget to press it, **drag** to slide or write. `start` and `stop` move the "
    "arm along its path, `speed` says how fast. **Drag** beside the widgets to lead the standing "
    "arm elsewhere; `point` teaches its posture as a point of the path."
)


# Of the robot "sara", on the surface where the page's visitors see it at first.
DEMO = {
    "start": WidgetDescription("button", "link1", at=(0.073, 0.02, 0.044), radius=0.025),
    "stop": WidgetDescription("button", "link1", at=(0.045, 0.066, 0.027), radius=0.025),
    "point": WidgetDescription("button", "link3", at=(0.047, 0.049, 0.046), radius=0.025),
    "speed": WidgetDescription(
        "slider",
        "link2",
        path=((0.069, 0.071, 0.084), (0.061, 0.063, 0.131), (0.052, 0.054, 0.178)),
        width=0.04,
        range=SPEEDS,
    ),
    "page": WidgetDescription(
        "pad", "link4", at=(-0.037, 0.064, 0.123), up=(-0.9, 0.0, -0.3), size=(0.1, 0.08), force=2.0
    ),
}


class Commanded:
    """Feels with a pipeline, and tells a `Touch` of every sample."""

    def __init__(self, robot: Robot, skin: Skin, touch: Touch) -> None:
        self._robot, self.touch = robot, touch
        self.torque = np.zeros(len(robot.joint_names))  # that is felt [Nm]
        self._pipeline = Pipeline(robot, skin=skin)

    def get(self, name: str) -> "Commanded":
        """Itself, whatever other method is wanted."""
        return self

    def take(self, samples: Samples) -> Felt:
        """What it makes of the next samples."""
        s = samples
        levels, wrench = [], []
        for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            result = self._pipeline.update(*row)
            self.touch.update(result)
            levels.append(result.detection.levels)
            wrench.append(result.estimate.segment_wrench)
        self.torque = np.nan_to_num(result.estimate.tau_ext)
        return Felt(
            self._robot.segment_names, s.time, np.array(levels), np.array(wrench),
            result.estimate.tau_ext, result.contacts, int(result.health),
        )  # fmt: skip


class InterfacePage(LivePage):
    """The live page whose arm has widgets; the mouse is a finger on its surface.

    Args:
        server: without anything on its page.
        seed: of the noise.
        robot: what `load_robot` takes; "sara" has the demo's widgets, another its `interface`.

    Attributes:
        touch: what tells of the widgets.
        read: what the recognizer made of each stroke: (label, probability).
    """

    def __init__(self, server: PageServer, seed: int = 1, robot: str = "sara") -> None:
        model = load_robot(robot)
        widgets = model.description.interface
        if not widgets and robot == "sara":
            widgets = DEMO
        if not widgets:
            raise InputError(f"{robot}: has no `interface` in its robot.yaml; sara has the demo's")
        self._widgets, self._path = widgets, TaughtPath(read_setup(model).home)
        self._recognizer = Recognizer()
        self._recognizer.learn(*plain_digits())
        self._fingers: list[Finger] = []
        self._led: dict[int, tuple[Finger, Array, Array]] = {}
        self.read: deque[tuple[str, float]] = deque(maxlen=TOLD)
        self._told: deque[str] = deque(maxlen=TOLD)
        super().__init__(server, seed, robot)
        self._controls.set(force=FORCE, stiffness=STIFFNESS)
        patches = {patch.link: patch for patch in self._skin.patches}
        self._areas = WidgetScene(self._page.scene, self.touch, patches)
        self._news = self._page.gui.add_html("")
        self._page.gui.add_markdown(ADVICE)
        let_touch({name: [area] for name, area in self._areas.areas.items()}, self, self.post)

    def _new_arm(self, seed: int) -> LiveArm:
        return LiveArm(self._full, self._skin, seed, self._path)

    def _new_method(self) -> Commanded:
        own = self._own
        robot = Robot(replace(own.description, interface=self._widgets), own.mechanism)
        self.touch = Touch(robot, self._skin)
        for name in self.touch.widgets:
            self.touch.on(name, self._on_event)
        self._commanded = Commanded(robot, self._skin, self.touch)
        return self._commanded

    def _on_event(self, event: TouchEvent) -> None:
        arm = self.arm
        if event.kind == "press" and event.widget in ("start", "stop"):
            self._controls.set(moving=event.widget == "start")
        elif event.kind == "press" and event.widget == "point":
            new = self._path.add(arm.q)
            self._tell(f"point {len(self._path.points)}" if new else "point: taught already")
        elif event.kind == "change" and event.widget == "speed":
            self._path.speed = float(event.value)
            return  # the knob shows it
        elif event.kind == "stroke" and isinstance(event.value, Stroke):
            label, probability = self._recognizer.read(event.value.cleaned())[0]
            self.read.append((label, probability))
            self._tell(f"written: {label} ({100 * probability:.0f} %)")
        self._tell(f"{event.time:.2f} s  {event.widget}: {event.kind}")

    def _tell(self, line: str) -> None:
        self._told.append(line)

    def press(self, origin: Array, direction: Array) -> None:
        """A visitor clicks along a ray: a short press."""
        finger = self._land(origin, direction)
        if finger is not None:
            finger.leaving = True

    def pull_begins(self, visitor: int, link: str, point: Array, eye: Array) -> None:
        """A visitor's finger lands at a point that is seen from `eye`."""
        self.pull_ends(visitor)
        finger = self._land(eye, point - eye)
        if finger is not None:
            self._led[visitor] = finger, point, eye

    def pull_moves(self, visitor: int, way: Array) -> None:
        """A visitor's mouse is that way (3,) [m] from where his finger landed."""
        if visitor not in self._led:
            return
        finger, start, eye = self._led[visitor]
        found = self._under(eye, start + way - eye)
        if found is not None and found[0] == finger.hand.link:
            finger.lead(found[1], found[2])

    def pull_ends(self, visitor: int) -> None:
        """A visitor's finger lifts once it has been everywhere."""
        if visitor in self._led:
            self._led.pop(visitor)[0].leaving = True

    def _land(self, origin: Array, direction: Array) -> Finger | None:
        found = self._under(origin, direction)
        if found is None:
            return None
        finger = Finger(*found, self._controls.force)
        self._fingers.append(finger)
        self.arm.hands.add(finger.hand)
        return finger

    def _under(self, origin: Array, direction: Array) -> tuple[str, Array, Array] | None:
        """Link, place and outward normal (3,) in its frame where a ray meets the arm."""
        for crossing in self._skin.crossings(self.arm.q, origin, direction):
            if crossing.entry and crossing.distance > 0:
                T = self.arm.robot.T_world_links(self.arm.q)[crossing.link]
                R = T[:3, :3].T
                return crossing.link, R @ (crossing.position - T[:3, 3]), R @ crossing.normal
        return None

    def _feel(self, rows: int) -> tuple[Array, list[Touched]]:
        """A part at a time, for fingers to move in between."""
        while rows > 0:
            part = PART if rows - PART >= 2 else rows
            for finger in self._fingers:
                finger.step(part * 1e-3)
            self._fingers = [finger for finger in self._fingers if not finger.hand.released]
            last = super()._feel(part)
            if self._is_guided():
                self.arm.lead(self._commanded.torque * part * 1e-3 / GUIDED)
            rows -= part
        return last

    def _is_guided(self) -> bool:
        """Does the arm stand, and a finger press on it that is on no widget?"""
        presses = [press for press in self.touch.presses if not press.finger.doubtful]
        return (
            bool(presses)
            and not self._controls.conditions().moving
            and all(
                press.widget is None and press.finger.duration(self.arm.time) > LATEST
                for press in presses
            )
        )

    def _show(self, q: Array, true: list[Touched]) -> None:
        super()._show(q, true)
        self._areas.show(self.touch)
        lines = "<br>".join(escape(line) for line in reversed(self._told))
        content = f'<div style="font-size:12px;padding:0 0.75em">{lines}</div>'
        if content != self._news.content:
            self._news.content = content
