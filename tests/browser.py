# SPDX-License-Identifier: Apache-2.0
"""A headless Chromium, driven by its DevTools protocol over a web socket."""

import base64
import io
import json
import os
import shutil
import subprocess
import tempfile
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Self

import numpy as np
from websockets.sync.client import connect

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = (
    "--headless",
    "--no-sandbox",
    "--no-first-run",
    "--no-default-browser-check",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-quic",
    "--disable-dev-shm-usage",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",  # draws in software
    # A picture that crosses from process to process by software may come after minutes or never.
    "--in-process-gpu",
    "--disable-gpu-compositing",
    "--remote-debugging-port=0",
    "--remote-allow-origins=*",
    "about:blank",
)
MISSING = "these tests need Chromium; on Debian: apt-get install chromium"
DOMAINS = ("Page", "Runtime", "Network", "Log")
PATIENCE = 60.0  # s, on a machine that is busy with other tests


def chromium() -> str | None:
    """The program, if it is installed."""
    return next((path for name in NAMES if (path := shutil.which(name))), None)


class Browser:
    """One window; everything that its page asks for and complains about is kept.

    Attributes:
        requests: addresses of all requests and web sockets, in their order.
        complaints: errors in the console, and exceptions that nothing caught.
    """

    def __init__(self, width: int = 1200, height: int = 760) -> None:
        program = chromium()
        assert program is not None, MISSING
        self._folder = tempfile.mkdtemp(prefix="touchline-browser-")
        self._process = subprocess.Popen(
            [program, *FLAGS, f"--user-data-dir={self._folder}", f"--window-size={width},{height}"],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            env={**os.environ, "HOME": self._folder},
        )
        self.requests: list[str] = []
        self.complaints: list[str] = []
        self._handlers: dict[str, Callable[[dict], None]] = {
            "Network.requestWillBeSent": lambda p: self.requests.append(p["request"]["url"][:200]),
            "Network.webSocketCreated": lambda p: self.requests.append(p["url"]),
            "Runtime.exceptionThrown": lambda p: self._complain(p["exceptionDetails"]),
            "Runtime.consoleAPICalled": self._on_console,
            "Log.entryAdded": self._on_entry,
            "Page.frameNavigated": lambda p: self._arrived.add(p["frame"]["loaderId"]),
        }
        self._arrived: set[str] = set()
        self._handlers["Target.attachedToTarget"] = self._on_worker
        self._count = 0
        try:
            self._socket = self._attach()
            for domain in DOMAINS:
                self.call(f"{domain}.enable")
            # Workers have requests and complaints of their own.
            self.call(
                "Target.setAutoAttach", autoAttach=True, waitForDebuggerOnStart=True, flatten=True
            )
            self.resize(width, height)
        except BaseException:
            self.close()
            raise

    def _attach(self) -> Any:
        port_file = Path(self._folder) / "DevToolsActivePort"
        until(lambda: port_file.is_file() and len(port_file.read_text().splitlines()) == 2)
        port, path = port_file.read_text().splitlines()
        self._socket = self._connect(f"ws://127.0.0.1:{port}{path}")
        pages = self.call("Target.getTargets")["targetInfos"]
        target = next(page["targetId"] for page in pages if page["type"] == "page")
        self._socket.close()
        return self._connect(f"ws://127.0.0.1:{port}/devtools/page/{target}")

    def _connect(self, url: str) -> Any:
        return connect(url, max_size=None, compression=None, proxy=None)

    def call(self, method: str, patience: float = PATIENCE, **params: Any) -> dict[str, Any]:
        """One command of the protocol, and its result; TimeoutError if it takes too long."""
        self._count += 1
        number = self._count
        end = time.monotonic() + patience
        self._socket.send(json.dumps({"id": number, "method": method, "params": params}))
        while True:  # what the page does meanwhile comes in between
            answer = json.loads(self._socket.recv(timeout=max(0.0, end - time.monotonic())))
            if answer.get("id") == number:
                assert "error" not in answer, f"{method}: {answer['error']}"
                return answer["result"]
            self._take(answer)

    def _on_worker(self, params: dict) -> None:
        for method in ("Network.enable", "Runtime.enable", "Runtime.runIfWaitingForDebugger"):
            self._count += 1
            message = {"id": self._count, "method": method, "sessionId": params["sessionId"]}
            self._socket.send(json.dumps(message))

    def rest(self, seconds: float) -> None:
        """Waits and listens to what the page does."""
        end = time.monotonic() + seconds
        while (left := end - time.monotonic()) > 0:
            try:
                self._take(json.loads(self._socket.recv(timeout=left)))
            except TimeoutError:
                return

    def _take(self, message: dict) -> None:
        handler = self._handlers.get(message.get("method", ""))
        if handler:
            handler(message["params"])

    def _complain(self, details: dict) -> None:
        thrown = details.get("exception", {}).get("description", "")
        self.complaints.append(f"{details.get('text', '')} {thrown}")

    def _on_console(self, params: dict) -> None:
        if params["type"] in ("error", "assert"):
            self.complaints.append(" ".join(str(a.get("value", a)) for a in params["args"]))

    def _on_entry(self, params: dict) -> None:
        if params["entry"]["level"] == "error":
            entry = params["entry"]
            self.complaints.append(f"{entry['text']} {entry.get('url', '')}")

    def resize(self, width: int, height: int, drawn: float = 1.0) -> None:
        """Size of the window [pixels], and how many pixels are drawn for each of its width."""
        size = {"width": width, "height": height, "deviceScaleFactor": drawn, "mobile": False}
        self.call("Emulation.setDeviceMetricsOverride", **size)

    def open(self, url: str) -> None:
        """Goes to an address; before the page is there it can be neither seen nor asked."""
        self.requests.clear()
        self.complaints.clear()
        answer = self.call("Page.navigate", url=url)
        assert "errorText" not in answer, f"{url}: {answer['errorText']}"
        until(lambda: answer["loaderId"] in self._arrived, pause=self.rest, what=url)

    def offline(self) -> None:
        """Cuts the network."""
        self.call(
            "Network.emulateNetworkConditions",
            offline=True,
            latency=0,
            downloadThroughput=0,
            uploadThroughput=0,
        )

    def run(self, script: str, patience: float = PATIENCE) -> Any:
        """The value of a JavaScript expression in the page; promises are awaited."""
        result = self.call(
            "Runtime.evaluate", patience, expression=script, returnByValue=True, awaitPromise=True
        )
        assert "exceptionDetails" not in result, result["exceptionDetails"]
        return result["result"].get("value")

    def text(self) -> str:
        """All that is written on the page."""
        return self.run("document.body && document.body.innerText") or ""

    def wait_for(self, text: str) -> None:
        """Until a text stands on the page."""
        until(lambda: text in self.text(), pause=self.rest, what=f"'{text}' on the page")

    def place(self, text: str) -> tuple[float, float]:
        """Middle [pixels] of the innermost visible element with just this text, or placeholder."""
        found = self.run(FIND % json.dumps(text))
        assert found, f"no '{text}' on the page:\n{self.text()}"
        return found[0], found[1]

    def press(self, text: str) -> None:
        """Clicks on the element with a text."""
        self.click(*self.place(text))

    def choose(self, label: str, option: str) -> None:
        """Takes an option of the drop-down list with a label; again if the page loses a click."""
        for _ in range(6):
            x, y = self._beside(label, "input:not([type=checkbox])")
            if self.run(f"document.elementFromPoint({x}, {y})?.value") == option:
                return
            self.click(x, y)
            if self._appears(option):
                self.press(option)
                self.draw()
        raise AssertionError(f"'{option}' cannot be chosen beside '{label}'")

    def _beside(self, label: str, kind: str) -> tuple[float, float]:
        """Middle [pixels] of the input to the right of a label, once the page stands still."""

        def found() -> list[float] | None:
            return self.run(FIND_INPUT % (json.dumps(kind), *self.place(label)))

        def settled() -> list[float] | None:
            before = found()
            self.draw()
            return before if before == found() else None

        x, y = until(settled, pause=self.rest, what=f"{kind} beside '{label}'")
        return x, y

    def _appears(self, text: str) -> bool:
        end = time.monotonic() + PATIENCE / 6
        while time.monotonic() < end:
            if self.run(FIND % json.dumps(text)):
                return True
            self.rest(0.05)
        return False

    def check(self, label: str) -> None:
        """Clicks on the box with a label, until that changes it: a list may still be closing."""
        found = self._beside(label, "input[type=checkbox]")
        state = f"document.elementFromPoint({found[0]}, {found[1]})?.checked"
        before = self.run(state)
        for _ in range(5):
            self.click(*found)
            self.draw()
            if self.run(state) != before:
                return
        raise AssertionError(f"the box beside '{label}' does not change")

    def click(self, x: float, y: float) -> None:
        """Moves there and clicks [pixels]."""
        self.drag((x, y), (x, y), steps=0)

    def draw(self, pictures: int = 2) -> None:
        """Waits until the page has been drawn that often."""
        script = "new Promise(drawn => requestAnimationFrame(drawn)).then(() => 0)"
        for _ in range(pictures):
            self._insist(lambda patience: self.run(script, patience), "draws nothing")
        self.rest(0.03)

    def _insist(self, ask: Callable[[float], Any], what: str) -> Any:
        """What the page answers; now and then it waits for a frame that never comes."""
        for patience in (*[PATIENCE / 4] * 5, PATIENCE, PATIENCE):  # or it is slow to draw
            try:
                return ask(patience)
            except TimeoutError:
                self.call("Page.bringToFront")
        raise AssertionError(f"the browser {what}")

    def mouse(self, kind: str, x: float, y: float, buttons: int = 0) -> None:
        """One event of the mouse: "Moved", "Pressed" or "Released"."""
        button = "left" if buttons or kind == "Released" else "none"
        self.call(
            "Input.dispatchMouseEvent",
            type=f"mouse{kind}",
            x=x,
            y=y,
            button=button,
            buttons=buttons,
            clickCount=0 if kind == "Moved" else 1,
        )

    def drag(
        self,
        start: tuple[float, float],
        end: tuple[float, float],
        steps: int = 8,
        release: bool = True,
    ) -> None:
        """Presses the left button at one place [pixels] and moves it to another."""
        self.mouse("Moved", *start)
        self.draw()  # the page finds out in its next picture what lies below the mouse
        self.mouse("Pressed", *start, buttons=1)
        for step in range(1, steps + 1):
            x, y = (a + (b - a) * step / steps for a, b in zip(start, end, strict=True))
            self.mouse("Moved", x, y, buttons=1)
            self.draw()
        if release:
            self.mouse("Released", *end)

    def picture(self, file: Path | str | None = None) -> np.ndarray:
        """What the window shows, (height, width, 3) of 0 to 255; also as a PNG file."""
        from PIL import Image

        data = base64.b64decode(self._screenshot())
        if file is not None:
            Path(file).write_bytes(data)
        return np.asarray(Image.open(io.BytesIO(data)).convert("RGB"))

    def _screenshot(self) -> str:
        call = partial(self.call, "Page.captureScreenshot", format="png")
        return self._insist(lambda patience: call(patience)["data"], "shows no picture")

    def close(self) -> None:
        """Ends the browser."""
        if hasattr(self, "_socket"):
            self._socket.close()
        self._process.terminate()
        try:
            self._process.wait(10)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()
        shutil.rmtree(self._folder, ignore_errors=True)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


FIND = """(() => {
  const wanted = %s, fits = [];
  for (const e of document.querySelectorAll("body *")) {
    const own = e.placeholder || e.innerText || "";
    const box = e.getBoundingClientRect();
    if (own.trim() === wanted && box.width > 0 && box.height > 0) fits.push(e);
  }
  if (!fits.length) return null;
  const e = fits[fits.length - 1];
  e.scrollIntoView({block: "nearest"});
  const box = e.getBoundingClientRect();
  return [box.x + box.width / 2, box.y + box.height / 2];
})()"""


# The input to the right of a label.
FIND_INPUT = """(() => {
  for (const e of document.querySelectorAll(%s)) {
    const box = e.getBoundingClientRect();
    if (box.x > %f && Math.abs(box.y + box.height / 2 - %f) < 12 && box.width > 0)
      return [box.x + box.width / 2, box.y + box.height / 2];
  }
  return null;
})()"""


def until(
    done: Callable[[], Any],
    patience: float = PATIENCE,
    pause: Callable[[float], None] = time.sleep,
    what: str = "the browser",
) -> Any:
    """Waits until something holds, and returns it."""
    end = time.monotonic() + patience
    while time.monotonic() < end:
        value = done()
        if value:
            return value
        pause(0.05)
    raise AssertionError(f"waited {patience:g} s for {what}")
