# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of pages in the README, in a headless Chromium.

Run `.venv/bin/python scripts/make_screenshots.py` from the repository after `make test` has set it
up. The pages are the real ones: `touchline demo`, pushed at three places while it simulates; the
report and the replay of `touchline demo --headless`.
"""

import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "tests"))

from browser import Browser, until  # noqa: E402

from touchline.cli import main as touchline  # noqa: E402
from touchline.view.live import LivePage  # noqa: E402
from touchline.view.replay import Replay  # noqa: E402
from touchline.view.replay_page import ReplayPage  # noqa: E402
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


def take_demo(browser: Browser) -> None:
    """Opens the page, pushes the arm, and keeps what the window shows."""
    with PageServer("Touchline", port=0) as server:
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


def take_report(browser: Browser, results: Path) -> None:
    """The report at an event."""
    browser.resize(1140, 860)
    browser.open((results / "report.html").as_uri())
    browser.wait_for("Against the truth")
    browser.run("document.querySelector('#event-1').scrollIntoView()")
    browser.rest(1.5)
    save(browser.picture(), TARGET / "report.webp")


def take_replay(browser: Browser, results: Path) -> None:
    """The replay while three places are touched."""
    browser.resize(*SIZE)
    with PageServer("Touchline: demo", port=0) as server:
        page = ReplayPage(Replay(results), server)

        def rest(seconds: float) -> None:
            page.step(seconds)
            browser.rest(seconds)

        browser.open(server.url)
        until(server.page.get_clients, pause=rest)
        browser.wait_for("Play")
        page.show(page.replay.events[1])
        page.step(0.0)
        browser.run(CALM)
        until(lambda: "event 1: " in browser.text(), pause=rest)
        for _ in range(30):
            rest(0.2)
        save(browser.picture(), TARGET / "view.webp")


def save(image: np.ndarray, path: Path) -> None:
    """Writes an image as WebP."""
    from PIL import Image

    Image.fromarray(image).save(path, "WEBP", quality=82, method=6)


def main() -> None:
    """Takes all of them."""
    with tempfile.TemporaryDirectory() as folder, Browser(*SIZE) as browser:
        take_demo(browser)
        results = Path(folder) / "demo"
        if touchline(["demo", "--headless", "--out", str(results)]) != 0:
            raise SystemExit("the demo failed")
        take_report(browser, results)
        take_replay(browser, results)
    for name in ("demo.png", "report.webp", "view.webp"):
        print(TARGET / name)


if __name__ == "__main__":
    main()
