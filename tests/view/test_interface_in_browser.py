# SPDX-License-Identifier: Apache-2.0
"""The demo's interface in a browser: the mouse presses a button and writes on the arm."""

import threading
from itertools import cycle, pairwise

import numpy as np
import pytest
from window import HARMLESS, Window

from touchline.view.finger import Finger
from touchline.view.interface import InterfacePage
from touchline.view.server import PageServer
from touchline.view.widgets import LIT

SEVEN = np.array([(-0.02, 0.025), (0.02, 0.025), (-0.008, -0.025)])  # m, on the pad
STEPS = 6  # of the mouse for each of its lines
BETWEEN = 0.25  # s of the simulation, in which the finger gets from one step to the next
WINDOW = 1100, 640, 0.3  # pixels, and how many are drawn for each; fewer are drawn sooner


@pytest.fixture
def demo():
    with PageServer("test", port=0) as server:
        page = InterfacePage(server)
        thread = threading.Thread(target=page.run)
        thread.start()
        yield page, server
        page.stop()
        thread.join()


def place_of(window, name, point):
    """Where a point (3,) [m] of a widget's link is in the window."""
    page = window.page
    T = page.arm.robot.T_world_links(page.arm.q)[page.touch.widgets[name].link]
    return window.pixel(T[:3, :3] @ point + T[:3, 3])


def kinds(page, name):
    return [event.kind for event in tuple(page.touch.events) if event.widget == name]


def lasts(window, duration):
    """Waits for a time [s] of the simulation, which a busy machine makes slower."""
    end = window.page.arm.time + duration
    window.until(lambda: window.page.arm.time > end, "the simulation to go on")


def stands(window):
    before = window.page.arm.q
    lasts(window, 0.3)
    return np.abs(window.page.arm.q - before).max() < 1e-4


@pytest.fixture
def led(monkeypatch):
    """Where fingers were led to: a busy browser makes one move of the mouse out of several."""
    places, lead = [], Finger.lead

    def kept(finger, point, normal):
        places.append(point)
        lead(finger, point, normal)

    monkeypatch.setattr(Finger, "lead", kept)
    return places


def drag_begins(window, start, towards):
    """Presses, and moves the mouse to and fro until the page leads a finger."""
    window.browser.mouse("Pressed", *start, buttons=1)
    places = cycle((towards, start))

    def led():
        window.browser.mouse("Moved", *next(places), buttons=1)
        window.browser.rest(0.1)
        return bool(window.page._led)

    window.until(led, "the drag to begin")


def test_the_mouse_presses_a_button_and_writes_a_seven(browser, demo, led):
    page, server = demo
    browser.resize(*WINDOW)
    window = Window(browser, page, server, pictures=False)
    window.until(lambda: page.arm.time > 0.3, "the simulation")
    heard = []
    page.touch.on("start", heard.append)
    start = page.touch.widgets["start"]
    browser.click(*place_of(window, "start", np.array(start.given.at)))
    window.until(lambda: "release" in kinds(page, "start"), "the button")
    assert [event.kind for event in heard[:2]] == ["press", "release"]
    assert page.arm._trajectory.wanted, "start moves the arm"
    window.until(lambda: "start: press" in browser.text(), "the press on the page")
    page.post(lambda: page._controls.set(moving=False))
    window.until(lambda: stands(window), "the arm to stand")

    pad = page.touch.widgets["page"]
    right, up, _ = pad.plane()
    ways = [np.linspace(a, b, STEPS) for a, b in zip(SEVEN[:-1], SEVEN[1:], strict=True)]
    places = [
        place_of(window, "page", np.array(pad.given.at) + u * right + v * up)
        for u, v in np.vstack(ways)
    ]
    browser.mouse("Moved", *places[0])
    browser.draw(4)  # the page finds out in its next pictures what lies below the mouse
    drag_begins(window, places[0], places[2])  # a shorter way would be a click
    for last, place in pairwise(places):
        before = len(led)
        browser.mouse("Moved", *place, buttons=1)
        if place != last:
            window.until(lambda known=before: len(led) > known, "the finger to be led on")
        lasts(window, BETWEEN)
    window.until(lambda: page._areas._lit.get("page"), "the pad to light")
    assert tuple(page._areas.areas["page"].color) == LIT
    browser.mouse("Released", *places[-1])
    window.until(lambda: len(page.read) > 0, "a stroke that is read")
    assert page.read[-1][0] == "7"
    window.until(lambda: "written: 7" in browser.text(), "the answer on the page")
    assert [c for c in browser.complaints if HARMLESS not in c] == []
    assert page.restarts == 0
