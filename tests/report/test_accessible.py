# SPDX-License-Identifier: Apache-2.0
"""The report can be read by all: axe-core finds nothing serious, and x, y, z have their colours."""

import json
import os
from pathlib import Path

import pytest

from touchline.report.plots import axis_class

AXE = Path(__file__).parents[2] / ".venv/npm/node_modules/axe-core/axe.min.js"
RUN = """axe.run().then((r) => JSON.stringify(r.violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => [v.id, v.nodes.length, v.nodes[0].html])))"""


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [390, 1360])
def test_axe_finds_nothing_serious(browser, analysis, width, scheme):
    if not AXE.is_file():
        assert not os.environ.get("CI"), f"{AXE}: no such file; scripts/setup.sh installs it"
        pytest.skip("axe-core is not installed: scripts/setup.sh does, where there is npm")
    browser.resize(width, 900)
    feature = {"name": "prefers-color-scheme", "value": scheme}
    browser.call("Emulation.setEmulatedMedia", features=[feature])
    try:
        browser.open((analysis.out / "report.html").as_uri())
        assert browser.run("document.documentElement.scrollWidth <= innerWidth")
        assert browser.run(f"matchMedia('(prefers-color-scheme: {scheme})').matches")
        browser.call("Runtime.evaluate", expression=AXE.read_text())
        told = {"awaitPromise": True, "returnByValue": True}
        found = browser.call("Runtime.evaluate", expression=RUN, **told)["result"]["value"]
        assert json.loads(found) == []
    finally:
        browser.call("Emulation.setEmulatedMedia", features=[])


def test_axes_have_colours_and_joints_have_others():
    assert [axis_class(name) for name in ("fx", "my", "fz")] == [" axis-x", " axis-y", " axis-z"]
    assert [axis_class(name) for name in ("joint1", "tz", "x", "fxy")] == [""] * 4
