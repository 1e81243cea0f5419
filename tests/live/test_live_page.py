# SPDX-License-Identifier: Apache-2.0
"""The page of a running robot, without a browser."""

import os
from dataclasses import replace

import pytest
from sockets import LOOPBACK, listening

from touchline.live.connection import Connection
from touchline.live.session import Session
from touchline.live.sources import make_source

pytest.importorskip("viser", reason="viser is not installed (pip install 'touchline[view]')")


def test_the_page_shows_streams_contacts_and_resets(sara, monkeypatch):
    from touchline.live.page import RobotPage
    from touchline.view.server import PageServer

    with (
        Session(sara, Connection(make_source("sim://?speed=0", sara))) as session,
        PageServer("test", "127.0.0.1", 0) as server,
    ):
        session.start()
        page = RobotPage(server, session, allow_control=True)
        monkeypatch.setattr(server.page, "get_clients", lambda: {0: None})
        texts = []
        for _ in session.run(2.6):
            page._drawn = page._written = 0.0
            page.update()
            texts.append(page._readout.content)
        assert "simulation: " in texts[-1]
        assert "<b>tool</b>" in texts[-1] and "located" in texts[-1]
        assert "lies below what can be felt there" not in texts[-1]
        page._can_be_felt["tool"] = replace(page._can_be_felt["tool"], force=1000.0)
        page._written = page._drawn = 0.0
        page.update()
        assert "on tool lies below what can be felt there" in page._readout.content
        page._asked.append(session.reset)
        page._written = page._drawn = 0.0
        page.update()
        assert session.result is None
        assert "withheld" in page._readout.content
        assert "reset: the estimate starts anew" in page._readout.content
        page._asked.append(session.tare)
        page._written = page._drawn = 0.0
        page.update()
        assert "tare needs 0.5 s of rest" in page._readout.content
        found = listening(os.getpid())
        assert found and all(address in LOOPBACK for kind, address, _ in found if kind[:3] == "tcp")
