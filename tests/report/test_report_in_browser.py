# SPDX-License-Identifier: Apache-2.0
"""The report in a browser without a network: it draws, zooms, prints, and asks for nothing."""

import re

import numpy as np
import pytest
from browser import until
from free_motion import free_motion, pushed

import touchline as tl
from touchline.logs import write_table
from touchline.report.analysis import analyze
from touchline.report.page import PLOT

FORCE = 'document.querySelector("[data-window] [data-plot] svg")'
WHOLE = 'document.querySelector("[data-panel] svg")'


@pytest.fixture
def report(browser, analysis):
    """The browser, at the report of an analysis, with the network cut."""
    browser.offline()
    browser.resize(1200, 900)
    browser.open((analysis.out / "report.html").as_uri())
    until(lambda: browser.run(f"{WHOLE}?.tabIndex === 0"), pause=browser.rest)
    return browser


def settled(browser):
    """Waits until the page scrolls no more; how far it has."""
    seen = []

    def still():
        seen.append(browser.run("scrollY"))
        return len(seen) > 4 and len(set(seen[-4:])) == 1

    until(still, pause=lambda _: browser.rest(0.1))
    return seen[-1]


def scroll_to(browser, plot):
    """Left, top, width and height of a plot [pixels], brought into view."""
    settled(browser)
    browser.run(f"{plot}.scrollIntoView({{block: 'center', behavior: 'instant'}})")
    until(lambda: browser.run(f"{plot}.tabIndex === 0"), pause=browser.rest)
    settled(browser)
    box = f"(() => {{const b = {plot}.getBoundingClientRect();"
    return browser.run(f"{box} return [b.x, b.y, b.width, b.height]}})()")


def span(browser, plot):
    """Numbers on the time axis of a plot, first and last, and its first curve."""
    texts = f"[...{plot}.querySelectorAll('text[text-anchor=middle]')].map((t) => t.textContent)"
    curve = browser.run(f"{plot}.querySelector('path.curve.s0').getAttribute('d')")
    ticks = [float(text) for text in browser.run(texts)]
    return (ticks[0], ticks[-1]), curve


def wheel(browser, x, y, turns):
    event = {"type": "mouseWheel", "x": x, "y": y, "deltaX": 0, "deltaY": turns}
    browser.call("Input.dispatchMouseEvent", **event)


def key(browser, name, text=""):
    browser.call("Input.dispatchKeyEvent", type="keyDown", key=name, text=text)
    browser.call("Input.dispatchKeyEvent", type="keyUp", key=name)


def changed(browser, plot, before):
    """What a plot shows once that is something else."""
    until(lambda: span(browser, plot) != before, pause=browser.rest, what="another picture")
    return span(browser, plot)


@pytest.mark.parametrize("plot", [FORCE, WHOLE], ids=["event", "recording"])
def test_wheel_keys_and_drag_zoom_a_plot_and_its_group(report, plot):
    x, y, width, height = scroll_to(report, plot)
    whole = span(report, plot)

    scrolled = report.run("scrollY")
    wheel(report, x + width / 2, y + height / 2, -100)
    until(lambda: report.run("scrollY") != scrolled, pause=report.rest)
    assert span(report, plot) == whole, "a plot that was not clicked lets the page scroll"
    x, y, width, height = scroll_to(report, plot)
    middle = x + width / 2, y + height / 2

    report.click(*middle)
    until(lambda: report.run(f"document.activeElement === {plot}"), pause=report.rest)
    wheel(report, *middle, -100)
    close = changed(report, plot, whole)
    wheel(report, *middle, -100)
    closer = changed(report, plot, close)
    assert np.ptp(closer[0]) < np.ptp(whole[0]) and settled(report) == report.run("scrollY")
    key(report, "ArrowRight")
    moved = changed(report, plot, closer)
    assert moved[0][1] > closer[0][1]
    key(report, "-", "-")
    changed(report, plot, moved)
    key(report, "0", "0")
    until(lambda: span(report, plot) == whole, pause=report.rest, what="all of it")

    report.drag((x + 0.35 * width, middle[1]), (x + 0.6 * width, middle[1]))
    dragged = changed(report, plot, whole)
    assert np.ptp(dragged[0]) < 0.5 * np.ptp(whole[0]) + 1e-9
    shown = report.run(
        f"[...{plot}.closest('.around, section').querySelectorAll('[data-plot], [data-panel]')]"
        ".map((p) => p.querySelector('text[text-anchor=middle]').textContent)"
    )
    assert len(set(shown)) == 1, "plots of a group show the same time"
    report.run(f"{plot}.dispatchEvent(new MouseEvent('dblclick'))")
    assert span(report, plot) == whole
    assert report.complaints == []


def test_nothing_is_asked_for_and_a_row_leads_to_its_event(report, analysis):
    report.run("document.querySelector('[data-event]').click()")
    figure = "document.querySelector('.event-figure')"
    until(lambda: abs(report.run(f"{figure}.getBoundingClientRect().top")) < 30, pause=report.rest)
    texts = f"[...{WHOLE}.querySelectorAll('text[text-anchor=middle]')].map((t) => t.textContent)"
    ticks = [float(text) for text in report.run(texts)]
    (event,) = analysis.events
    assert ticks[0] > event.detected - 1.0 and ticks[-1] < event.cleared + 1.0
    asked = [url for url in report.requests if not url.startswith(("data:", "file:"))]
    assert asked == [] and report.complaints == []


def test_the_drawn_curve_is_that_of_the_estimates(report, analysis):
    """The path of the event's force, taken back to newtons by the numbers on the axis."""
    scroll_to(report, FORCE)
    labels = f"[...{FORCE}.querySelectorAll('text[text-anchor=end]')]"
    pairs = report.run(f"{labels}.map((t) => [Number(t.textContent), Number(t.getAttribute('y'))])")
    (v0, y0), (v1, y1) = pairs[0], pairs[-1]
    path = span(report, FORCE)[1]
    heights = [float(y) for y in re.findall(r"[ML][\d.]+ (-?[\d.]+)", path)]
    drawn = v0 + (np.array(heights) + 4 - y0) * (v1 - v0) / (y1 - y0)
    (event,) = analysis.events
    window = analysis.windows.get(event)
    panel = next(p for p in analysis.curves.event_panels("base") if p.title == "base: force")
    low, high = window.of(panel.curves[0].column)
    assert drawn.max() == pytest.approx(np.nanmax(high), abs=0.5)
    assert drawn.min() == pytest.approx(np.nanmin(low), abs=0.5)


def test_it_is_readable_without_script_and_in_print(browser, analysis):
    browser.offline()
    browser.call("Emulation.setScriptExecutionDisabled", value=True)
    browser.call("Emulation.setEmulatedMedia", media="print")
    browser.open((analysis.out / "report.html").as_uri())
    browser.rest(1.0)
    pages = browser.call("Page.printToPDF", preferCSSPageSize=False)
    assert len(pages["data"]) > 50_000
    browser.resize(1100, 4000)
    browser.rest(0.5)
    image = browser.picture()
    assert image[5, 5].min() == 255  # paper is white, also where the screen is dark
    blue = (image[..., 2].astype(int) - image[..., 0] > 60).sum(axis=1)
    rows = np.flatnonzero(blue > 3)  # curves, without the script
    assert len(rows) > PLOT[1]
    assert browser.complaints == []


SAVED = """(() => {
  window.saved = [];
  URL.createObjectURL = (blob) => {
    const known = { type: blob.type, size: blob.size, text: "" };
    saved.push(known);
    blob.arrayBuffer().then((b) => { known.text = new TextDecoder("latin1").decode(b); });
    return "#";
  };
  HTMLAnchorElement.prototype.click = function () { saved.at(-1).name = this.download; };
})()"""


def test_a_plot_is_saved_as_csv_and_png(report):
    report.run(SAVED)
    plot = "document.querySelector('[data-panel]')"
    title = report.run(f"{plot}.querySelector('header b').textContent")
    for kind in ("CSV", "PNG"):
        report.run(
            f"[...{plot}.querySelectorAll('.save')].find((b) => b.textContent === '{kind}').click()"
        )
    until(lambda: report.run("saved.length === 2 && saved.every((s) => s.text)"), pause=report.rest)
    table, picture = sorted(report.run("saved"), key=lambda s: s["type"], reverse=True)
    head, *rows = table["text"].splitlines()
    unit = "[of the contact threshold]"
    assert head == f"time [s],largest test least {unit},largest test largest {unit}"
    assert len(rows) > 500
    numbers = np.array([[float(x or "nan") for x in row.split(",")] for row in rows])
    assert (np.diff(numbers[:, 0]) > 0).all() and np.nanmax(numbers[:, 2]) > 1.0
    assert (numbers[:, 2] >= numbers[:, 1])[np.isfinite(numbers[:, 1])].all()
    assert picture["text"][1:4] == "PNG" and picture["size"] > 3000
    height = 256 * ord(picture["text"][22]) + ord(picture["text"][23])
    assert height > 2 * PLOT[1] + 40, "title, unit and key stand above the curves"
    assert table["name"].endswith(".csv") and title.split(":")[0] in table["name"]


def test_an_address_names_a_time_or_an_event(browser, analysis):
    browser.offline()
    browser.resize(1200, 900)
    page = (analysis.out / "report.html").as_uri()
    shown = "document.getElementById('shown')?.textContent"
    browser.open(f"{page}#t=2.5,4")
    until(lambda: browser.run(shown) == "2.50 s to 4.00 s", pause=browser.rest)
    event = analysis.events[0]
    browser.run(f"location.hash = '#event-{event.id}'")
    until(lambda: browser.run(shown) != "2.50 s to 4.00 s", pause=browser.rest)
    first, last = (float(word.split()[0]) for word in browser.run(shown).split(" to "))
    assert first < event.detected < last and last - first < 3.0
    numbers = "[...document.querySelectorAll('svg text.number')].map((t) => t.textContent)"
    assert str(event.id) in browser.run(numbers)


def test_numbers_of_simultaneous_events_stand_beside_each_other(browser, tmp_path):
    robot, force = tl.load_robot("sara"), [12.0, 9.0, 13.0]
    samples = free_motion(robot, seconds=4.0, rate=200.0)
    for link, rows in (("link2", (200, 300)), ("handle", (201, 260)), ("tool", (204, 240))):
        samples = pushed(robot, samples, link, slice(*rows), force)
    samples = pushed(robot, samples, "link2", slice(600, 700), force)
    write_table(tmp_path / "log.parquet", samples, robot.description)
    analysis = analyze(tmp_path / "log.parquet", "sara", tmp_path / "out")
    spans = [(event.id, event.segment, event.detected, event.cleared) for event in analysis.events]
    assert [id for id, *_ in spans] == [0, 1, 2, 3], spans
    browser.offline()
    browser.resize(1200, 900)
    browser.open((analysis.out / "report.html").as_uri())
    until(lambda: browser.run(f"{WHOLE}?.tabIndex === 0"), pause=browser.rest)
    scroll_to(browser, "[...document.querySelectorAll('[data-panel] svg')].at(-1)")
    plots = browser.run(
        "[...document.querySelectorAll('svg')].map((svg) =>"
        "  [...svg.querySelectorAll('text.number')].map((text) => {"
        "    const box = text.getBoundingClientRect();"
        "    return [text.textContent, box.x, box.right, box.y, box.bottom]; }))"
    )
    assert ["0, 1, 2", "3"] in [[text for text, *_ in plot] for plot in plots]
    for plot in plots:
        for i, (_, left, right, top, bottom) in enumerate(plot):
            others = plot[:i]
            assert not any(
                x < right and left < r and y < bottom and top < b for _, x, r, y, b in others
            )
