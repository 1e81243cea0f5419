# SPDX-License-Identifier: Apache-2.0
"""What axe-core finds serious on a page, at the widths and colours that visitors have."""

import json
import os
from pathlib import Path

import pytest
from browser import until

AXE = Path(__file__).parents[1] / ".venv/npm/node_modules/axe-core/axe.min.js"
RUN = """axe.run().then((r) => JSON.stringify(r.violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => [v.id, v.nodes.length, v.nodes[0].html])))"""
WIDTHS = (390, 1360)  # pixels
SCHEMES = ("light", "dark")


def need_axe() -> None:
    """Skips the test without axe-core; in CI it fails."""
    if not AXE.is_file():
        assert not os.environ.get("CI"), f"{AXE}: no such file; scripts/setup.sh installs it"
        pytest.skip("axe-core is not installed: scripts/setup.sh does, where there is npm")


def look(browser, width: int, scheme: str) -> None:
    """Sets the window's width and the system's colours."""
    browser.resize(width, 900)
    feature = {"name": "prefers-color-scheme", "value": scheme}
    browser.call("Emulation.setEmulatedMedia", features=[feature])


def serious(browser) -> list:
    """Rule, number of places and the first of them, of the page that is open."""
    until(lambda: browser.run("document.readyState") == "complete", what="the whole page")
    assert browser.run("document.documentElement.scrollWidth <= innerWidth")
    browser.call("Runtime.evaluate", expression=AXE.read_text())
    told = {"awaitPromise": True, "returnByValue": True}
    return json.loads(browser.call("Runtime.evaluate", expression=RUN, **told)["result"]["value"])
