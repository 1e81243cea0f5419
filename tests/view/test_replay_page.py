# SPDX-License-Identifier: Apache-2.0
"""The page of a replay in a browser: the arm as it stood, time that goes on, events jumped to."""

import numpy as np
from browser import until
from projection import count_near, pixel

from touchline.model.surface import link_surface
from touchline.view.markers import COLOURS
from touchline.view.replay import Replay
from touchline.view.replay_page import ReplayPage, faint_events
from touchline.view.scene import ALARM, TINT
from touchline.view.server import PageServer
from touchline.view.signals import JOINTS

VIOLET = COLOURS["truth"]


class Visitor:
    """A browser on the page, which is drawn while the browser waits."""

    def __init__(self, browser, page, server):
        self.browser, self.page = browser, page
        browser.resize(1500, 900)
        browser.open(server.url)
        clients = server.page.get_clients
        (self.client,) = until(lambda: list(clients().values()), pause=self.rest)
        browser.wait_for("Play")

    def rest(self, seconds):
        self.page.step(seconds)
        self.browser.rest(seconds)

    def until(self, done, what):
        return until(done, pause=self.rest, what=what)

    def pixel(self, point):
        """Where a point of the world stands in the window; the picture has panels beside it."""
        box = "(() => {const b = document.querySelector('canvas').getBoundingClientRect();"
        left, top = self.browser.run(f"{box} return [b.x, b.y]}})()")
        column, row = pixel(self.client.camera, point)
        return column + left, row + top

    def arm_stands(self, time):
        """Whether the arm covers the middles of its links as they were at a time."""
        replay, image = self.page.replay, self.browser.picture()
        poses = replay.robot.T_world_links(replay.posture(time))
        places = [self.pixel(poses[link][:3, 3]) for link in ("link2", "link3", "link5", "link7")]
        return all(image[round(row), round(column)].min() < 244 for column, row in places)

    def tinted(self, link, colour, time, contact):
        """The part of a link's points next to the camera, not beside the contact, of a colour."""
        replay = self.page.replay
        T = replay.robot.T_world_links(replay.posture(time))[link]
        vertices = link_surface(replay.robot.mechanism.links[link], "visual").vertices
        points = vertices @ T[:3, :3].T + T[:3, 3]
        points = points[np.linalg.norm(points - contact.position, axis=1) > 0.05]
        near = np.linalg.norm(points - self.client.camera.position, axis=1).argsort()[:180:12]
        image = self.browser.picture()
        places = [self.pixel(point) for point in points[near]]
        return np.mean([count_near(image, *place, colour, 2) > 12 for place in places])


def test_a_replay_is_seen_played_and_jumped_in(browser, touched):
    replay = Replay(touched.out)
    with PageServer("test", port=0) as server:
        page = ReplayPage(replay, server)
        visitor = Visitor(browser, page, server)
        visitor.until(lambda: visitor.arm_stands(replay.start), "the arm at the start")

        browser.press("next")
        event = replay.events[0]
        visitor.until(lambda: f"event {event.id}: {event.link}" in browser.text(), "the event")
        time = page.player.time
        assert event.detected < time < event.cleared
        (contact,) = replay.contacts(time)
        row = np.searchsorted(touched.samples.time, time)
        off = np.linalg.norm(contact.position - touched.truth.point[row], axis=1)
        assert np.nanmin(off) < 5e-3  # it is where the arm was touched

        def point_is_shown():
            place = visitor.pixel(contact.position)
            return count_near(browser.picture(), *place, COLOURS["estimate"]) > 15

        assert "the truth of the simulation" in browser.text()
        visitor.until(
            lambda: (
                count_near(browser.picture(), *visitor.pixel(contact.position), VIOLET, 25) > 15
            ),
            "the true point around it",
        )
        visitor.until(point_is_shown, "the contact's point")
        assert visitor.arm_stands(time)
        tint = ALARM if event.level == "collision" else TINT
        visitor.until(
            lambda: visitor.tinted(event.link, tint, time, contact) > 0.5, "the link's colour"
        )

        charts = "Object.values(window.__viserTestpoints.uplots).map((u) => u.chart)"
        spans = f"{charts}.map((c) => [c.scales.x.min, c.scales.x.max, c.data[0][0]])"
        visitor.until(
            lambda: all(
                low <= time <= high and low == first for low, high, first in browser.run(spans)[1:]
            ),
            "curves around the event",
        )

        browser.press("Play")
        visitor.until(lambda: page.player.time > event.cleared + 0.05, "time to go on")
        visitor.until(lambda: "nothing touches" in browser.text(), "the end of the event")
        visitor.until(lambda: not page.player.playing, "the end of the recording")
        visitor.until(lambda: f"{replay.end:.3f} s" in browser.text(), "the last time")
        visitor.until(lambda: visitor.arm_stands(replay.end), "the arm at the end")
        assert not point_is_shown()
        visitor.until(
            lambda: visitor.tinted(event.link, tint, replay.end, contact) == 0,
            "the link's own colour",
        )
        charts = "Object.values(window.__viserTestpoints.uplots).map((u) => u.chart)"
        drawn = browser.run(f"{charts}.map((c) => [c.scales.x.min, c.scales.x.max])")
        assert len(drawn) == 3 and all(low < high for low, high in drawn)
        series = f"{charts}.map((c) => c.series.map((s) => s.label).join(' '))"
        assert "time [s] fx fy fz no data now" in browser.run(series)
        page.plots[0].choose(JOINTS)
        curves = " ".join(["time [s]", *replay.robot.joint_names, "no data now"])
        visitor.until(lambda: browser.run(series).count(curves) == 2, "other curves")
        assert browser.complaints == []


def test_events_weaker_than_what_is_surely_felt_are_told(touched):
    replay = Replay(touched.out)
    assert replay.events and faint_events(replay) == {}
    weak = next(event for event in replay.events if event.link is not None)
    replay.events = [weak.replace(force_peak=0.1)]
    told = faint_events(replay)
    assert told[weak.id].startswith(f"event {weak.id}: 0.1 N on {weak.link} lies below what can be")
