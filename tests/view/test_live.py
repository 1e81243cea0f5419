# SPDX-License-Identifier: Apache-2.0
"""The live page in a browser: the arm is pushed by the mouse, and the page tells what it feels."""

import threading

import numpy as np
import pytest
from projection import count_near
from window import HARMLESS, Window

from touchline.view.live import LivePage
from touchline.view.markers import COLOURS
from touchline.view.moments import METRES_PER_NEWTON
from touchline.view.server import PageServer


@pytest.fixture
def live():
    with PageServer("test", port=0) as server:
        page = LivePage(server)
        thread = threading.Thread(target=page.run)
        thread.start()
        yield page, server
        page.stop()
        thread.join()


def test_the_mouse_pushes_the_arm_and_the_page_shows_what_it_feels(browser, live):
    page, server = live
    assert page.arm.time == 0.0, "nothing moves while nobody looks"
    window = Window(browser, page, server)
    window.until(lambda: page.arm.time > 0.3, "the simulation")

    start = window.link("link4")
    browser.drag(start, (start[0] + 90, start[1] + 30), release=False)
    verdict = window.until(lambda: window.feels("link4"), "a contact on link4")
    assert verdict.level > 0 and verdict.segment == "base"
    browser.rest(1.5)
    window.until(lambda: (v := window.feels("link4")) and v.position_error, "its place")
    verdict = window.feels("link4")
    assert len(verdict.true) == 1 and verdict.true[0].link == "link4"
    assert verdict.position_error < 0.02 and verdict.force_error < 2.0
    assert 0.0 < verdict.delay < 0.5

    image = browser.picture()
    contact = verdict.contact
    column, row = window.pixel(contact.position)
    tail = window.pixel(contact.position - 0.7 * METRES_PER_NEWTON * contact.force)
    colours = (COLOURS["estimate"], COLOURS["truth"])
    for place in ((column, row), tail):
        assert sum(count_near(image, *place, colour, 6) for colour in colours) > 8
    assert "collision" in browser.text() or "contact" in browser.text()
    browser.mouse("Released", start[0] + 90, start[1] + 30)
    window.until(lambda: not page.arm.hands.active() and window.feels("link4") is None, "calm")

    browser.click(*window.link("link4"))
    verdict = window.until(lambda: window.feels("link4"), "a push by a click")
    (hand,) = page.arm.hands.active()
    assert hand.target is None and np.linalg.norm(hand.force) == pytest.approx(25.0)
    browser.press("Random push")
    window.until(lambda: len(page.arm.hands.active()) == 2, "another push")
    browser.press("Remove all pushes")
    window.until(lambda: not page.arm.hands.active(), "no pushes")
    window.until(lambda: all(v.level == 0 for v in page.verdicts), "nothing felt")
    assert [c for c in browser.complaints if HARMLESS not in c] == []
    port = server.page.get_port()
    own = (f"http://127.0.0.1:{port}/", f"ws://127.0.0.1:{port}", f"blob:http://127.0.0.1:{port}/")
    assert [url for url in browser.requests if not url.startswith((*own, "data:"))] == []


def test_switches_reach_the_arm_and_it_rests_when_nobody_looks(browser, live):
    page, server = live
    window = Window(browser, page, server)
    window.until(lambda: page.felt is not None, "the simulation")
    for label, choice, reached in (
        ("Method", "paper", lambda: page._method._name == "paper"),
        ("Sensor fault", "wrist sensor: silent", lambda: page.felt.health & 72 != 0),
        ("Arm", "moves", lambda: page.arm._trajectory.wanted),
    ):
        browser.choose(label, choice)
        window.until(reached, f"{label}: {choice}")
    browser.check("Sensor noise")
    window.until(lambda: page.arm._noise is None, "no noise")
    window.until(lambda: "sensor excluded" in browser.text(), "the sensor's absence on the page")
    q = page.arm.q
    window.until(lambda: np.abs(page.arm.q - q).max() > 0.02, "the arm to move")
    browser.open("about:blank")
    window.until(lambda: not server.page.get_clients(), "the page to be left")
    browser.rest(0.5)
    stood = page.arm.time
    browser.rest(1.0)
    assert page.arm.time == stood
    assert browser.complaints == []
