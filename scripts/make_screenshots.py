# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of pages in the README, in a headless Chromium.

Run `.venv/bin/python scripts/make_screenshots.py` from the repository after `make test` has set it
up. The page is the real one: `touchline demo`, pushed at three places while it simulates.
"""

import sys
import threading
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from browser import Browser, until  # noqa: E402

from touchline.view.live import LivePage  # noqa: E402
from touchline.view.server import PageServer  # noqa: E402

TARGET = ROOT / "docs" / "images"
SIZE = (1360, 760)
# Rays that push: from where, towards which link's origin, offset from it [m], and force [N].
PUSHES = [
    ((0.1, 2.0, 1.0), "link3", (0.0, 0.0, 0.12), 30.0),
    ((2.0, 0.8, 0.6), "tool", (0.0, 0.0, -0.05), 15.0),
    ((0.6, -0.6, 2.0), "handle", (0.0, 0.0, 0.0), 20.0),
]
CALM = "document.querySelectorAll('[class*=Notification-closeButton]').forEach(b => b.click())"


def push(page: LivePage) -> None:
    """Puts the hands on the arm."""
    poses = page.arm.robot.T_world_links(page.arm.q)
    for eye, link, offset, force in PUSHES:
        T = poses[link]
        surface = next(p.surface for p in page.arm.skin.patches if p.link == link)
        vertices = surface.vertices @ T[:3, :3].T + T[:3, 3] - np.array(eye)
        aim = T[:3, 3] + np.array(offset) - np.array(eye)
        off = np.linalg.norm(np.cross(vertices, aim / np.linalg.norm(aim)), axis=1)
        hand = page.arm.press(np.array(eye), vertices[np.argmin(off)], force)
        if hand is None or hand.link != link:
            print(f"the push on {link} meets {hand.link if hand else 'nothing'}", file=sys.stderr)


def main() -> None:
    """Opens the page, pushes the arm, and keeps what the window shows."""
    with PageServer("Touchline", port=0) as server, Browser(*SIZE) as browser:
        page = LivePage(server)
        thread = threading.Thread(target=page.run)
        thread.start()
        try:
            browser.open(server.url)
            browser.wait_for("Random push")
            until(lambda: page.arm.time > 3.0, 60, browser.rest, "the simulation")
            page.post(lambda: push(page))
            browser.run(CALM)
            until(lambda: page.arm.time > 9.0, 60, browser.rest, "the simulation")
            browser.picture(TARGET / "demo.png")
        finally:
            page.stop()
            thread.join()
    print(TARGET / "demo.png")


if __name__ == "__main__":
    main()
