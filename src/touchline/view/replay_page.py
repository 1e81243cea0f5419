# SPDX-License-Identifier: Apache-2.0
"""The page of a replay: the arm as it stood, what was felt, and a time line with the events."""

import time as clock
from threading import RLock

import numpy as np
import viser

from touchline.check.felt import felt
from touchline.result.contact import Contact
from touchline.result.event import Event
from touchline.view.contacts import ContactScene, candidates
from touchline.view.player import Player
from touchline.view.readout import STATUS_WORDS
from touchline.view.replay import Replay
from touchline.view.scene import RobotScene, dress
from touchline.view.server import PageServer
from touchline.view.signals import JOINTS, SignalPlot, force_on, signal_groups, torque_of
from touchline.view.timeline import Timeline

EPOCH = 1e6  # s; stamps beyond it are dates, and the page counts from the first
FRAME = 1 / 30  # s; between pictures
PLOTTED = 0.1  # s; between plots while it plays
IDLE = 0.2  # s; between looks for visitors while there are none
SPEEDS = {"1/10": 0.1, "1/4": 0.25, "1/2": 0.5, "1": 1.0, "2": 2.0, "5": 5.0, "20": 20.0}
WINDOWS = {"1 s": 1.0, "5 s": 5.0, "20 s": 20.0, "60 s": 60.0, "whole recording": None}
BROAD = 0.8  # width over height of a view that shows an arm with its arrows
VIEW = (0.78, 0.58, 0.33)  # from the middle to the camera, in sizes of the space that the arm uses
CURVES_WIDTH = 440  # pixels
NAMED = 3  # candidates in words
HELP = (
    "Move **time**, press **Play**, or choose an event. Drag over the arm to look around it. "
    "Orange: what was felt; pale orange: places that cannot be told apart."
)
TRUTH = " Violet outlines: the truth of the simulation."


class ReplayPage:
    """A replay in the browser; `run` keeps it going.

    Args:
        replay: what is shown.
        server: that shows it.

    Attributes:
        player: the time shown; `lock` is held while it changes.
        plots: of curves.
    """

    def __init__(self, replay: Replay, server: PageServer) -> None:
        self.replay, self.lock = replay, RLock()
        self.player = Player(replay.start, replay.end, replay.events)
        self._origin = replay.start if abs(replay.start) > EPOCH else 0.0
        self._page = server.page
        dress(self._page)
        look_from(self._page.initial_camera, replay)
        self._page.on_client_connect(_keep_in_view)
        self._arm = RobotScene(self._page.scene, replay.robot)
        self._contacts = ContactScene(self._page.scene, self._arm)
        self._faint = faint_events(replay)
        self._build(self._page.gui)
        self._drawn: tuple = ()
        self._plotted = -np.inf
        self.draw()

    def _build(self, gui: viser.GuiApi) -> None:
        gui.add_markdown(HELP + TRUTH * bool(self.replay.truth))
        self._timeline = Timeline(gui, self.replay, self._origin)
        first, last = (round(t - self._origin, 3) for t in (self.replay.start, self.replay.end))
        self._slider = gui.add_slider("time [s]", first, max(last, first + 1e-3), 1e-3, first)
        self._play = gui.add_button("Play")  # an icon takes 0.1 s to read
        self._step = gui.add_button_group("event", ("previous", "next"))
        self._titles = {self._title(event): event for event in self.replay.events}
        names = tuple(self._titles) or ("none",)
        self._choice = gui.add_dropdown("jump to", ("-", *names), initial_value="-")
        self._speed = gui.add_dropdown("speed", tuple(SPEEDS), initial_value="1")
        self._felt = gui.add_markdown("")
        panel = gui.add_panel()
        with panel.add_tab("Curves"):
            self._window = gui.add_dropdown("time", tuple(WINDOWS), initial_value="5 s")
            groups = signal_groups(self.replay.robot, self.replay.signals)
            first_two = (next(name for name in groups if name != JOINTS), JOINTS)
            self.plots = [
                SignalPlot(gui, self.replay, self._origin, groups, name) for name in first_two
            ]
        panel.dock_left()
        panel.set_width(CURVES_WIDTH)
        gui.main_panel.dock_right()  # beside the arm instead of before it
        self._slider.on_update(self._on_slider)
        self._play.on_click(lambda _: self._toggle())
        self._step.on_click(lambda e: self._jump(-1 if e.target.value == "previous" else 1))
        self._choice.on_update(self._on_choice)
        self._speed.on_update(self._on_speed)

    def _title(self, event: Event) -> str:
        where = event.link or event.segment
        return f"{event.id}: {event.detected - self._origin:.2f} s, {event.level} on {where}"

    def _on_slider(self, event: viser.GuiEvent) -> None:
        if event.client_id is None:  # it was set by the page itself
            return
        with self.lock:
            self.player.playing = False
            self.player.seek(float(self._slider.value) + self._origin)

    def _on_choice(self, event: viser.GuiEvent) -> None:
        found = self._titles.get(str(self._choice.value))
        if event.client_id is not None and found is not None:
            self.show(found)

    def _on_speed(self, _: viser.GuiEvent) -> None:
        with self.lock:
            self.player.speed = SPEEDS[str(self._speed.value)]

    def _toggle(self) -> None:
        with self.lock:
            if self.player.playing:
                self.player.playing = False
            else:
                self.player.play()

    def _jump(self, step: int) -> None:
        with self.lock:
            event = self.player.neighbour(step)
            if event is not None:
                self.show(event)

    def show(self, event: Event) -> None:
        """Stops at an event, and shows the wrench on its segment."""
        with self.lock:
            self.player.show(event)
            self.plots[0].choose(force_on(event.segment), torque_of(event.joint or ""))

    def run(self) -> None:
        """Draws for as long as the program lasts; costs little while nobody looks."""
        before = clock.monotonic()
        while True:
            now = clock.monotonic()
            passed, before = now - before, now
            if not self._page.get_clients():
                clock.sleep(IDLE)
                continue
            self.step(min(passed, 0.5))
            clock.sleep(max(FRAME - (clock.monotonic() - now), 0.002))

    def step(self, seconds: float) -> None:
        """So many seconds have passed: goes on and draws what has changed."""
        with self.lock:
            self.player.advance(seconds)
        self.draw()

    def draw(self) -> None:
        """Brings the page up to date with the player and the choices."""
        with self.lock:
            time, playing = self.player.time, self.player.playing
        state = (time, playing, self._window.value, *(plot.chosen for plot in self.plots))
        if state == self._drawn:
            return
        self._drawn = state
        with self._page.atomic():
            contacts = self.replay.contacts(time)
            q = self.replay.posture(time)
            self._arm.place(q)
            self._contacts.show(contacts, self.replay.true_contacts(time), q)
            self._slider.value = round(time - self._origin, 3)
            label = "Pause" if playing else "Play"
            if self._play.label != label:
                self._play.label = label
            words = self._words(contacts, time)
            if self._felt.content != words:
                self._felt.content = words
        if not playing or clock.monotonic() - self._plotted > PLOTTED:
            self._plotted = clock.monotonic()
            length = WINDOWS[str(self._window.value)]
            with self._page.atomic():
                self._timeline.update(time)
                for plot in self.plots:
                    plot.update(time, length)

    def _words(self, contacts: list[Contact], time: float) -> str:
        lines = [f"**{time - self._origin:.3f} s**"]
        for contact in contacts:
            lines.append(f"* event {contact.event}: {_sentence(contact)}")
            if contact.event in self._faint:
                lines.append(f"* {self._faint[contact.event]}")
        if not contacts:
            lines.append("* nothing touches")
        return "\n".join(lines)


def faint_events(replay: Replay) -> dict[int, str]:
    """A line for each event that is weaker than what is surely felt on its link."""
    able = {one.link: one for one in felt(replay.robot)} if replay.events else {}
    lines = {}
    for event in replay.events:
        if event.link in able and event.force_peak is not None:
            told = able[event.link].faint(f"event {event.id}", event.force_peak)
            if told is not None:
                lines[event.id] = told
    return lines


def look_from(camera: viser.InitialCameraConfig, replay: Replay) -> None:
    """Sets the camera so that it has the arm in view wherever it goes."""
    times = np.linspace(replay.start, replay.end, 24)
    poses = [replay.robot.T_world_links(replay.posture(t)) for t in times]
    points = np.array([T[:3, 3] for pose in poses for T in pose.values()])
    low, high = points.min(axis=0), points.max(axis=0)
    middle = (low + high) / 2
    size = max(float(np.linalg.norm(high - low)), 0.3)
    camera.look_at = tuple(middle)
    camera.position = tuple(middle + size * np.array(VIEW))


def _keep_in_view(client: viser.ClientHandle) -> None:
    """Moves the camera away where panels leave a narrow view, or arrows would be cut off."""
    camera, moved = client.camera, [1.0]

    def fit(_: viser.CameraHandle) -> None:
        farther = max(1.0, BROAD / camera.aspect)
        if abs(farther / moved[0] - 1.0) > 0.02:
            offset = (camera.position - camera.look_at) * farther / moved[0]
            moved[0] = farther
            camera.position = camera.look_at + offset

    camera.on_update(fit)
    fit(camera)


def _sentence(contact: Contact) -> str:
    parts = [f"**{contact.link or contact.segment}**, {contact.level}"]
    if contact.force is not None:
        parts.append(f"{float(np.linalg.norm(contact.force)):.1f} N")
    if contact.position_std is not None:
        parts.append(f"\N{PLUS-MINUS SIGN} {1e3 * contact.position_std:.1f} mm")
    if contact.status != "located":
        parts.append(STATUS_WORDS.get(contact.status, contact.status))
    likely = candidates(contact)
    if len(likely) > 1:
        parts += [f"{100 * c.probability:.0f} % {c.link}" for c in likely[:NAMED]]
    return ", ".join(parts)
