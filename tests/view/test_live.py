# SPDX-License-Identifier: Apache-2.0
"""The live page in a browser: the arm is pushed by the mouse, and the page tells what it feels."""

import threading

import numpy as np
import pytest
from browser import until
from projection import count_near, pixel

from touchline.view.live import LivePage
from touchline.view.markers import COLOURS, METRES_PER_NEWTON
from touchline.view.server import PageServer

# Chromium says so whenever viser lets a drag on an object keep the camera still; nothing is lost.
HARMLESS = "Unable to preventDefault inside passive event listener invocation."


@pytest.fixture
def live():
    with PageServer("test", port=0) as server:
        page = LivePage(server)
        thread = threading.Thread(target=page.run)
        thread.start()
        yield page, server
        page.stop()
        thread.join()


class Window:
    """The page in the browser, with the places of things in the arm's world."""

    def __init__(self, browser, page, server) -> None:
        self.browser, self.page = browser, page
        browser.open(server.url)
        browser.wait_for("Random push")
        clients = until(server.page.get_clients, pause=browser.rest)
        self.camera = next(iter(clients.values())).camera
        self.until(self._arm_is_drawn, "the arm in the picture")

    def pixel(self, point) -> tuple[float, float]:
        x, y = pixel(self.camera, point)
        canvas = "document.querySelector('canvas').getBoundingClientRect()"
        left, top = self.browser.run(f"(b => [b.x, b.y])({canvas})")
        return x + left, y + top

    def link(self, name) -> tuple[float, float]:
        """Where the origin of a link, which is within it, is in the window."""
        return self.pixel(self.page.arm.robot.T_world_links(self.page.arm.q)[name][:3, 3])

    def _arm_is_drawn(self) -> bool:
        column, row = (round(x) for x in self.link("link4"))
        patch = self.browser.picture()[row - 5 : row + 6, column - 5 : column + 6]
        return bool((patch.min(axis=-1) < 250).all())

    def until(self, done, what):
        return until(done, pause=self.browser.rest, what=what)

    def verdict(self, segment):
        return next((v for v in self.page.verdicts if v.segment == segment), None)

    def feels(self, link):
        """What is felt if it is located on a link."""
        for verdict in self.page.verdicts:
            if verdict.contact is not None and verdict.contact.link == link:
                return verdict
        return None


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
