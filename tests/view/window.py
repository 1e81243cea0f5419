# SPDX-License-Identifier: Apache-2.0
"""The live page in the browser, with the places of things in the arm's world."""

from browser import until
from projection import pixel

# Chromium says so whenever viser lets a drag on an object keep the camera still; nothing is lost.
HARMLESS = "Unable to preventDefault inside passive event listener invocation."


class Window:
    """The page in the browser, with the places of things in the arm's world.

    Args:
        browser: that opens it.
        page: that is served.
        server: of the page.
        pictures: whether to wait until a picture shows the arm, or for what the page draws.
    """

    def __init__(self, browser, page, server, pictures: bool = True) -> None:
        self.browser, self.page = browser, page
        browser.open(server.url)
        browser.wait_for("Random push")
        clients = until(server.page.get_clients, pause=browser.rest)
        self.camera = next(iter(clients.values())).camera
        if pictures:
            self.until(self._arm_is_drawn, "the arm in the picture")
        else:
            browser.draw()

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
