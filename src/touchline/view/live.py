# SPDX-License-Identifier: Apache-2.0
"""The live page: the simulated arm, what touches it and what it feels, in real time."""

import queue
import sys
import threading
import time
import traceback
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from html import escape
from typing import Protocol

import numpy as np

from touchline.arrays import Array
from touchline.check.felt import felt as felt_on_links
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot, load_robot
from touchline.simulation.hands import Hand
from touchline.view.arm import RATE, LiveArm
from touchline.view.contacts import ContactScene
from touchline.view.controls import Controls
from touchline.view.faults import faults_of
from touchline.view.grasp import let_touch
from touchline.view.history import History
from touchline.view.judge import Judge, Touched, Verdict, touched
from touchline.view.methods import METHODS, Felt, Method, fully_measured, methods_of
from touchline.view.plots import WrenchPlots
from touchline.view.readout import Speed, readout
from touchline.view.scene import RobotScene, dress
from touchline.view.server import PageServer

FRAME = 1.0 / 30.0  # s between two pictures
READOUT, PLOTS = 0.2, 0.25  # s between two of them
LATEST = 0.2  # s by which the simulation may be late before it gives up catching up
REACTION_ROWS = 4  # samples after which the arm may react
SMOOTHING = 0.05  # weight of a frame in the mean speed
NOTICE = 20.0  # s for which the page shows why the arm began anew
RESTART_PAUSE = 0.5  # s; a fault that comes back at once must not fill the processor


class LivePage:
    """Everything on the page; nothing moves while nobody looks.

    Args:
        server: without anything on its page.
        seed: of the motion, the noise and random pushes.
        robot: what `load_robot` takes.

    Attributes:
        arm: that is simulated.
        verdicts: of the last frame.
        felt: in the last frame.
        restarts: how often a frame failed and the arm began anew.
    """

    def __init__(self, server: PageServer, seed: int = 1, robot: str = "sara") -> None:
        # The robot's own sensors, and a torque sensor in every joint for the methods that need one.
        self._own = load_robot(robot)
        self._full = load_robot("sara-full") if robot == "sara" else fully_measured(self._own)
        self._skin = Skin(self._own)
        self._can_be_felt = {one.link: one for one in felt_on_links(self._own)}
        self._seed, self.restarts = seed, 0
        self.arm = self._new_arm(seed)
        self._todo: queue.SimpleQueue[Callable[[], object]] = queue.SimpleQueue()
        self._pulls: dict[int, Hand] = {}
        self._page = server.page
        dress(self._page)
        self._robot = RobotScene(self._page.scene, self._own)
        self._robot.place(self.arm.q)
        self._contacts = ContactScene(self._page.scene, self._robot)
        self._controls = Controls(
            self._page.gui,
            lambda: self.post(lambda: self.arm.push_anywhere(self._controls.force)),
            lambda: self.post(self.arm.hands.release_all),
            methods_of(self._own),
            faults_of(self._full),
        )
        self._history = History(self._own.segment_names)
        self._plots = _in_panel_of_their_own(self._page, self._history)
        let_touch(self._robot.meshes, self, self.post)
        self._method = self._new_method()
        self._judge = Judge(self._own)
        self.felt: Felt | None = None
        self.verdicts: list[Verdict] = []
        self._speed = Speed()
        self._due = {READOUT: 0.0, PLOTS: 0.0}
        self._notice_ends = np.inf
        self._stopping = threading.Event()
        self._watched = threading.Event()
        self._page.on_client_connect(lambda _: self._watched.set())

    def _new_method(self) -> "Chooser":
        return _Chosen(self._own, self._full, self._skin)

    def _new_arm(self, seed: int) -> LiveArm:
        return LiveArm(self._full, self._skin, seed)

    def press(self, origin: Array, direction: Array) -> None:
        """A visitor clicks along a ray."""
        self.arm.press(origin, direction, self._controls.force)

    def pull_begins(self, visitor: int, link: str, point: Array, eye: Array) -> None:
        """A visitor takes hold of a link."""
        self.pull_ends(visitor)
        self._pulls[visitor] = self.arm.pull(link, point, eye, self._controls.force)

    def pull_moves(self, visitor: int, way: Array) -> None:
        """A visitor's mouse is that way (3,) [m] from the place that he holds."""
        hand = self._pulls.get(visitor)
        if hand is not None:
            hand.target = self.arm.grip(hand) + way

    def pull_ends(self, visitor: int) -> None:
        """A visitor lets it go, or leaves the pull where it is."""
        hand = self._pulls.pop(visitor, None)
        if hand is not None and not self._controls.keep:
            hand.released = True

    def post(self, call: Callable[[], object]) -> None:
        """Has something called between two frames; the arm belongs to the thread of `run`."""
        self._todo.put(call)

    def stop(self) -> None:
        """Ends `run`."""
        self._stopping.set()
        self._watched.set()

    def run(self, seconds: float = np.inf) -> None:
        """Simulates in real time while somebody looks, for some seconds at most."""
        end = time.monotonic() + seconds
        last = time.monotonic()
        while not self._stopping.is_set() and (now := time.monotonic()) < end:
            if not self._page.get_clients():
                self._watched.clear()
                self._watched.wait(min(1.0, end - now))
                last = time.monotonic()
                continue
            rows = round(min(now - last, LATEST) * RATE)
            if rows >= 2:
                self._measure(rows / RATE, now - last)
                last = now if now - last > LATEST else last + rows / RATE
                self.frame_or_restart(rows)
            self._stopping.wait(max(0.0, FRAME - (time.monotonic() - now)))

    def _measure(self, simulated: float, real: float) -> None:
        share = self._speed.real_time + SMOOTHING * (simulated / real - self._speed.real_time)
        self._speed = Speed(self._speed.step, share)

    def frame_or_restart(self, rows: int) -> None:
        """A frame; if it fails, the page says so and the arm begins anew."""
        try:
            self.frame(rows)
        except Exception as error:  # whatever it is, the page goes on
            traceback.print_exc(file=sys.stderr)
            self._restart(error)
            self._stopping.wait(RESTART_PAUSE)
        if time.monotonic() > self._notice_ends:
            self._controls.notice.content, self._notice_ends = "", np.inf

    def _restart(self, error: Exception) -> None:
        """A new arm with its method, and a notice of what ended the old one."""
        self.restarts += 1
        while not self._todo.empty():
            self._todo.get()
        self._pulls.clear()
        self._history.clear()
        self.felt, self.verdicts = None, []
        self.arm = self._new_arm(self._seed + self.restarts)
        self._method = self._new_method()
        self._judge = Judge(self._own)
        self._controls.notice.content = notice(error)
        self._notice_ends = time.monotonic() + NOTICE

    def frame(self, rows: int) -> None:
        """Simulates `rows` samples and shows what came of them.

        Raises:
            FloatingPointError: the simulated arm is nowhere.
        """
        while not self._todo.empty():
            self._todo.get()()
        conditions = self._controls.conditions()
        self.arm.set(conditions)
        part = rows if conditions.reaction == "ignore" else REACTION_ROWS
        while rows >= 2:
            part = part if rows - part >= 2 else rows
            last, true = self._feel(part)
            rows -= part
        self._show(last, true)

    def _feel(self, rows: int) -> tuple[Array, list[Touched]]:
        """Simulates and feels; returns the last joint positions and true contacts."""
        method = self._method.get(self._controls.method)
        samples, truth = self.arm.advance(rows)
        if not np.isfinite(samples.q).all():
            raise FloatingPointError("the simulated arm's joint positions are not finite")
        began = time.perf_counter()
        felt = self.felt = method.take(samples)
        step = (time.perf_counter() - began) / rows
        smooth = self._speed.step + SMOOTHING * (step - self._speed.step)
        self._speed = Speed(smooth, self._speed.real_time)
        self.arm.feel(felt.contacts, felt.tau_ext)
        self.verdicts = self._judge.judge(felt, truth, self.arm.hands.active())
        self._history.add(felt.time, felt.segments, felt.wrench)
        return samples.q[-1], touched(truth)

    def _show(self, q: Array, true: list[Touched]) -> None:
        with self._page.atomic():
            self._robot.place(q)
            felt = [verdict.contact for verdict in self.verdicts if verdict.contact is not None]
            self._contacts.show(felt, [(t.point, t.force) for t in true], q)
            self._contacts.show_pulls(self.arm.springs())
        if self._is_due(READOUT) and self.felt is not None:
            self._controls.readout.content = readout(
                self.verdicts, self.felt.health, self._speed, self._can_be_felt
            )
        if self._is_due(PLOTS):
            self._plots.refresh()

    def _is_due(self, pause: float) -> bool:
        now = time.monotonic()
        if now < self._due[pause]:
            return False
        self._due[pause] = now + pause
        return True


def notice(error: Exception) -> str:
    """HTML that says why the arm begins anew."""
    what = escape(f"{type(error).__name__}: {error}"[:200])
    return (
        '<div role="alert" style="font-size:12px;padding:0 0.75em;color:var(--alarm)">'
        f"The simulation failed and the arm was started again. {what}</div>"
    )


class Chooser(Protocol):
    """Which method feels now."""

    def get(self, name: str) -> Method:
        """The method to use now, for one that is wanted."""
        ...


class _Chosen:
    """The method that is chosen; one that takes long to make starts when it is ready."""

    def __init__(self, own: Robot, full: Robot, skin: Skin) -> None:
        self._parts = (own, full, skin)
        self._maker = ThreadPoolExecutor(1)
        self._name = next(iter(METHODS))
        self._method: Method = METHODS[self._name](*self._parts)
        self._making: Future[Method] | None = None

    def get(self, name: str) -> Method:
        """The method to use now, for one that is wanted."""
        if name != self._name:
            self._name = name
            self._making = self._maker.submit(METHODS[name], *self._parts)
        if self._making is not None and self._making.done():
            self._method, self._making = self._making.result(), None
        return self._method


def _in_panel_of_their_own(page, history: History) -> WrenchPlots:
    panel = page.gui.add_panel()
    with panel.add_tab("Segments"):
        plots = WrenchPlots(page.gui, history)
    panel.dock_left()
    panel.set_width(300)
    page.gui.main_panel.dock_right()
    page.gui.main_panel.set_width(370)
    return plots
