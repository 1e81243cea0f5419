# SPDX-License-Identifier: Apache-2.0
"""All that can be used on pages of arms has a name and can be read: axe-core finds nothing serious.

Nothing moves on these pages, so that the browser has time for axe-core.
"""

import pytest
from accessible import SCHEMES, WIDTHS, look, need_axe, serious
from browser import until

import touchline as tl
from touchline.live.connection import Connection
from touchline.live.page import RobotPage
from touchline.live.session import Session
from touchline.live.sources import make_source
from touchline.view.interface import InterfacePage
from touchline.view.live import LivePage
from touchline.view.replay import Replay
from touchline.view.replay_page import ReplayPage
from touchline.view.server import PageServer

# On a telephone: is the panel as wide as the page, and below the view?
BELOW = """(() => {
  const view = document.querySelector("canvas").getBoundingClientRect();
  const panel = document.querySelector(".mantine-Paper-root").getBoundingClientRect();
  return view.height > 300 && view.bottom <= panel.top + 1 && panel.width === innerWidth;
})()"""


def check(browser, server, words):
    """The page as it opens, in the system's colours, and once its window has another width."""
    need_axe()
    for opened, scheme in zip(WIDTHS, SCHEMES, strict=True):
        look(browser, opened, scheme)
        browser.open(server.url)
        browser.wait_for(words)
        scheme_is = "document.documentElement.dataset.mantineColorScheme"
        assert browser.run(scheme_is) == scheme
        for width in sorted(WIDTHS, key=lambda width: width != opened):
            look(browser, width, scheme)
            if width < 576:
                until(lambda: browser.run(BELOW), pause=browser.rest, what="the panel below")
            until(lambda: serious(browser) == [], pause=browser.rest, what="no finding of axe-core")


@pytest.mark.parametrize("kind", [InterfacePage, LivePage])
def test_pages_of_the_demo(browser, kind):
    with PageServer("test", port=0) as server:
        kind(server)
        check(browser, server, "Random push")


def test_the_page_of_a_replay(browser, touched):
    with PageServer("test", port=0) as server:
        ReplayPage(Replay(touched.out), server)
        check(browser, server, "Play")


def test_the_page_of_a_running_robot(browser):
    robot = tl.load_robot("sara")
    with (
        Session(robot, Connection(make_source("sim://?speed=0", robot))) as session,
        PageServer("test", port=0) as server,
    ):
        RobotPage(server, session, allow_control=True)
        check(browser, server, "Tare")
