# SPDX-License-Identifier: Apache-2.0
"""The report can be read by all: axe-core finds nothing serious, and x, y, z have their colours."""

import json
import os
from pathlib import Path

import pytest
from browser import until

from touchline.report.plots import axis_class

AXE = Path(__file__).parents[2] / ".venv/npm/node_modules/axe-core/axe.min.js"
RUN = """axe.run().then((r) => JSON.stringify(r.violations
  .filter((v) => ["serious", "critical"].includes(v.impact))
  .map((v) => [v.id, v.nodes.length, v.nodes[0].html])))"""

# Those that the script has drawn, as the page's events come near the window only by scrolling.
PLOTS = """[...document.querySelectorAll(".plot")]
  .filter((plot) => plot.querySelector("path.curve[clip-path]"))"""
COLOURS = f"""{PLOTS}.map((plot) => [".key", "path.curve"].map((which) =>
  [...plot.querySelectorAll(which)].map((one) => getComputedStyle(one).color)))
  .map(([keys, curves]) => [keys, curves.reverse()])"""  # drawn last to first
DRAWN = (
    f"{PLOTS}.flatMap((p) => [...p.querySelectorAll('path.curve')].map((c) => c.className.baseVal))"
)


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


def test_a_curve_has_the_colour_of_its_key(browser, analysis):
    browser.resize(1360, 900)
    browser.open((analysis.out / "report.html").as_uri())
    until(lambda: browser.run(COLOURS), what="curves of the script")
    told = browser.run(COLOURS)
    assert sum(len(keys) for keys, _ in told) > 20
    assert all(keys == curves for keys, curves in told), told
    assert any("axis-x" in name for name in browser.run(DRAWN))


def test_axes_have_colours_and_joints_have_others():
    assert [axis_class(name) for name in ("fx", "my", "fz")] == [" axis-x", " axis-y", " axis-z"]
    assert [axis_class(name) for name in ("joint1", "tz", "x", "fxy")] == [""] * 4
