# SPDX-License-Identifier: Apache-2.0
"""The demo's interface without a browser: fingers press, slide and write on the simulated arm."""

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.view.interface import InterfacePage
from touchline.view.path import TaughtPath
from touchline.view.server import PageServer

EYE = np.array([1.45, 1.05, 1.05])


@pytest.fixture(scope="module")
def page():
    with PageServer("test", port=0) as server:
        made = InterfacePage(server)
        run(made, 30)  # the observer settles
        yield made


def run(page, frames):
    for _ in range(frames):
        page.frame(33)


def point(page, widget, place):
    T = page.arm.robot.T_world_links(page.arm.q)[widget.link]
    return T[:3, :3] @ place + T[:3, 3]


def click(page, name):
    widget = page.touch.widgets[name]
    page.press(EYE, point(page, widget, np.array(widget.given.at)) - EYE)
    run(page, 25)


def draw(page, name, places):
    """A finger that is led through places (N, 3) in the link's frame."""
    ways = [point(page, page.touch.widgets[name], place) for place in places]
    page.pull_begins(1, "", ways[0], EYE)
    for way in ways:
        page.pull_moves(1, way - ways[0])
        page.frame(33)
    page.pull_ends(1)
    run(page, 60)


def test_buttons_start_and_stop_the_arm(page):
    for name, moving in (("start", True), ("stop", False)):
        click(page, name)
        assert [e.kind for e in page.touch.events if e.widget == name][:2] == ["press", "release"]
        assert page.arm._trajectory.wanted is moving
    assert page.restarts == 0


def test_a_hand_leads_the_arm_to_a_point_of_its_path(page):
    run(page, 90)  # it stands again
    home = page.arm.q
    link = page.arm.robot.T_world_links(home)["link6"][:3, 3]
    page.pull_begins(2, "", link, EYE)
    run(page, 60)
    page.pull_ends(2)
    run(page, 60)
    there = page.arm.q
    assert np.abs(there - home).max() > 0.1, "the arm was led elsewhere"
    run(page, 30)
    assert np.abs(page.arm.q - there).max() < 0.01, "and stays there"
    click(page, "point")
    assert "point 2" in page._told and len(page._path.points) == 2
    click(page, "point")
    assert len(page._path.points) == 2, "taught already"
    click(page, "start")
    ways = []
    for _ in range(60):
        run(page, 5)
        ways.append([np.abs(page.arm.q - q).max() for q in page._path.points])
    click(page, "stop")
    assert np.min(ways, axis=0).max() < 0.03, "it goes to both points"
    run(page, 90)


def test_the_slider_sets_the_speed(page):
    widget = page.touch.widgets["speed"]
    draw(page, "speed", [widget.point_at(value) for value in np.linspace(0.1, 0.9, 9)])
    assert page.touch.values["speed"] == pytest.approx(widget.scaled(0.9), abs=0.06)
    assert page._path.speed == page.touch.values["speed"]


@pytest.mark.parametrize(
    ("sign", "corners"),
    [
        ("7", [(-0.02, 0.025), (0.02, 0.025), (-0.008, -0.025)]),
        ("1", [(0.0, 0.025), (0.0, -0.025)]),
    ],
)
def test_what_is_drawn_is_read(page, sign, corners):
    widget = page.touch.widgets["page"]
    right, up, _ = widget.plane()
    way = np.vstack([np.linspace(a, b, 7) for a, b in zip(corners, corners[1:], strict=False)])
    draw(page, "page", np.array(widget.given.at) + way @ np.array([right, up]))
    assert page.read[-1][0] == sign


def test_a_robot_without_an_interface_is_told():
    with PageServer("test", port=0) as server, pytest.raises(InputError, match="interface"):
        InterfacePage(server, robot="sara-full")


def test_a_taught_path_goes_to_and_fro_and_rests_in_its_points():
    path = TaughtPath(np.zeros(2))
    assert not path.add(np.array([0.001, 0.0])) and path.add(np.array([0.4, -0.2]))
    time = np.arange(0.0, 12.0, 0.01)
    q = np.array([path(t).q for t in time])
    assert q.min(axis=0) == pytest.approx([0.0, -0.2], abs=1e-3)
    assert q.max(axis=0) == pytest.approx([0.4, 0.0], abs=1e-3)
    assert np.abs(np.diff(q, axis=0)).max() / 0.01 <= 1.01 * path.speed
