# SPDX-License-Identifier: Apache-2.0
"""The report can be read by all: axe-core finds nothing serious, and x, y, z have their colours."""

import pytest
from accessible import SCHEMES, WIDTHS, look, need_axe, serious
from browser import until

from touchline.report.plots import axis_class

# Those that the script has drawn, as the page's events come near the window only by scrolling.
PLOTS = """[...document.querySelectorAll(".plot")]
  .filter((plot) => plot.querySelector("path.curve[clip-path]"))"""
COLOURS = f"""{PLOTS}.map((plot) => [".key", "path.curve"].map((which) =>
  [...plot.querySelectorAll(which)].map((one) => getComputedStyle(one).color)))
  .map(([keys, curves]) => [keys, curves.reverse()])"""  # drawn last to first
DRAWN = (
    f"{PLOTS}.flatMap((p) => [...p.querySelectorAll('path.curve')].map((c) => c.className.baseVal))"
)


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_axe_finds_nothing_serious(browser, analysis, width, scheme):
    need_axe()
    look(browser, width, scheme)
    browser.open((analysis.out / "report.html").as_uri())
    assert browser.run(f"matchMedia('(prefers-color-scheme: {scheme})').matches")
    assert serious(browser) == []


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
