# SPDX-License-Identifier: Apache-2.0
"""A running robot on a page: how it stands, what it feels, and how its streams are."""

import html
import time
from collections.abc import Callable

import numpy as np

from touchline.check.felt import felt
from touchline.errors import InputError
from touchline.health import Health
from touchline.live.session import Session
from touchline.live.streams import StreamState
from touchline.result.kinds import Watch
from touchline.view.contacts import ContactScene
from touchline.view.controls import FELT_MARK
from touchline.view.scene import RobotScene, dress
from touchline.view.server import PageServer
from touchline.view.widgets import WidgetScene

FRAME = 0.05  # s between two pictures: a browser gets no more, however fast the robot is
READOUT = 0.25  # s between two of them
COLOURS = {StreamState.OK: "#009e73", StreamState.SLOW: "#e69f00"}
BAD = "#d55e00"


class RobotPage:
    """The page of `touchline live --view`; nothing on it commands the robot.

    Args:
        server: without anything on its page.
        session: that is shown.
        allow_control: whether visitors may let the estimate start anew, and tare.
    """

    def __init__(self, server: PageServer, session: Session, allow_control: bool = False) -> None:
        self._session, self._page = session, server.page
        dress(self._page)
        self._robot = RobotScene(self._page.scene, session.robot)
        self._contacts = ContactScene(self._page.scene, self._robot)
        self._widgets: WidgetScene | None = None
        if session.touch is not None:
            self._widgets = WidgetScene(self._page.scene, session.touch, session.touch.patches)
        self._can_be_felt = {one.link: one for one in felt(session.robot)}
        self._readout = self._page.gui.add_html("")
        self._asked: list[Callable[[], str]] = []
        self._answer = ""
        if allow_control:
            for text, act in (("Reset", session.reset), ("Tare (nothing may touch)", session.tare)):
                self._page.gui.add_button(text).on_click(lambda _, act=act: self._asked.append(act))
        self._drawn, self._written = -np.inf, -np.inf

    def update(self) -> None:
        """Shows what is new, if a picture is due; called between two reads."""
        now = time.monotonic()
        if now - self._drawn < FRAME:
            return
        self._drawn = now
        while self._asked:
            try:
                self._answer = self._asked.pop(0)()
            except InputError as error:
                self._answer = str(error)
        session = self._session
        if not self._page.get_clients() or session.sample is None:
            return
        result, q = session.result, np.nan_to_num(session.sample.q)
        with self._page.atomic():
            self._robot.place(q)
            self._contacts.show([] if result is None else result.contacts, [], q)
            if self._widgets is not None and session.touch is not None:
                self._widgets.show(session.touch)
        if now - self._written >= READOUT:
            self._written = now
            self._readout.content = self._text(now)

    def _text(self, now: float) -> str:
        lines = []
        for stream in self._session.connection.streams:
            colour = COLOURS.get(stream.state(now), BAD)
            told = html.escape(stream.describe(now))
            lines.append(f'<span style="color:{colour}">&#9679;</span> {told}')
        result = self._session.result
        if result is None:
            lines.append("<b>no honest estimate now: it is withheld</b>")
        else:
            bits = [bit.name for bit in Health if result.health & bit and bit.name]
            lines.append(f"health: {', '.join(bits).lower() or 'all is well'}")
            pipeline = self._session.pipeline
            if pipeline is not None and pipeline.lost:
                lines.append(f"<b>without {html.escape(', '.join(pipeline.lost))}</b>")
            for segment, watch in zip(self._session.robot.segment_names, result.watch, strict=True):
                if watch != Watch.WATCHED:
                    lines.append(f"segment {html.escape(segment)}: <b>{watch}</b>")
            for contact in result.contacts:
                where = contact.link or contact.likely_link or contact.segment
                told = contact.status.replace("_", " ")
                if contact.status != "located" and contact.body_probability is not None:
                    told += f", {contact.body_probability:.0%}"
                lines.append(f"<b>{html.escape(where)}</b>: {contact.size:.1f} N, {told}")
                able = self._can_be_felt.get(where)
                if able is not None and (told := able.faint("faint", contact.size)) is not None:
                    lines.append(html.escape(told))
        if self._answer:
            lines.append(html.escape(self._answer))
        lines.append(FELT_MARK)
        return f'<div style="font-size:12px;padding:0 0.75em 0.75em">{"<br>".join(lines)}</div>'
