# SPDX-License-Identifier: Apache-2.0
"""Makes the pictures of pages in the README, in a headless Chromium.

Run `.venv/bin/python scripts/make_screenshots.py [demo] [report] [view]` from the repository after
`make test` has set it up; without a name it makes all. The pages are the real ones: `touchline
demo`, pushed at three places while it simulates; the report and the replay of `touchline demo
--headless`.
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


def take_demo(browser: Browser, _: Path) -> Path:
    """Opens the page, pushes the arm, and keeps what the window shows."""
    browser.resize(*SIZE)
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
    return TARGET / "demo.png"


def take_report(browser: Browser, results: Path) -> Path:
    """The report at an event."""
    browser.resize(1140, 860)
    browser.open((results / "report.html").as_uri())
    browser.wait_for("Against the truth")
    browser.run("document.querySelector('#event-1').scrollIntoView()")
    browser.rest(1.5)
    return save(browser.picture(), TARGET / "report.webp")


def take_replay(browser: Browser, results: Path) -> Path:
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
        return save(browser.picture(), TARGET / "view.webp")


def save(image: np.ndarray, path: Path) -> Path:
    """Writes an image as WebP, and says where."""
    from PIL import Image

    Image.fromarray(image).save(path, "WEBP", quality=82, method=6)
    return path


def main(names: list[str]) -> None:
    """Takes those that are named, or all."""
    unknown = [name for name in names if name not in PICTURES]
    if unknown:
        raise SystemExit(
            f"no picture is called {', '.join(unknown)}; there are {', '.join(PICTURES)}"
        )
    names = names or list(PICTURES)
    with tempfile.TemporaryDirectory() as folder, Browser(*SIZE) as browser:
        results = Path(folder) / "demo"
        if set(names) - {"demo"} and touchline(["demo", "--headless", "--out", str(results)]) != 0:
            raise SystemExit("the demo failed")
        for name in names:
            print(PICTURES[name](browser, results))


PICTURES = {"demo": take_demo, "report": take_report, "view": take_replay}

if __name__ == "__main__":
    main(sys.argv[1:])
