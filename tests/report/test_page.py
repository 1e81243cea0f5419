# SPDX-License-Identifier: Apache-2.0
"""The report: self-contained, small, and honest about what was recorded."""

import base64
import json
import re
from html.parser import HTMLParser

import numpy as np
import pytest

from touchline.report.page import page_text
from touchline.report.statistics import Moments

VOID = {"meta", "line", "br", "hr", "img", "input", "link"}


@pytest.fixture(scope="module")
def page(analysis):
    return (analysis.out / "report.html").read_text()


def data_of(page):
    return json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])


class Balance(HTMLParser):
    def __init__(self):
        super().__init__()
        self.open, self.problems = [], []

    def handle_starttag(self, tag, attrs):
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        if not self.open or self.open.pop() != tag:
            self.problems.append((tag, self.getpos()))


def test_every_tag_is_closed_and_names_are_escaped(page):
    parser = Balance()
    parser.feed(page)
    assert parser.problems == [] and parser.open == []
    assert "a &lt;b&gt; &amp; c.parquet" in page and "a <b>" not in page


def test_nothing_is_fetched(page):
    body = re.sub(r'id="data">.*?</script>', "", page, flags=re.S)
    body = re.sub(r' href="(data:image/webp;base64,[A-Za-z0-9+/=]*|#event-[0-9]+)"', "", body)
    for saved in ("link.href = URL.createObjectURL(blob)", 'image.src = "data:image/svg+xml;'):
        body = body.replace(saved, "")  # what the page itself holds, as a file
    assert "default-src 'none'" in body
    assert not re.search(r"""(src|href)\s*=|@import|url\((?!#)|fetch\(|XMLHttp""", body)
    addresses = set(re.findall(r"https?://[^\"' )]+", body))
    assert addresses <= {"http://www.w3.org/2000/svg"}
    assert len(page) < 5e6


def test_curves_are_those_of_the_estimates(analysis, page):
    data = data_of(page)
    torque = data["panels"][1]  # joint2 has a sensor
    packed = data["curves"][torque["columns"][0]]
    numbers = np.frombuffer(base64.b64decode(packed["high"]), "<i2")
    values = np.where(numbers == -32768, np.nan, packed["middle"] + packed["step"] * numbers)
    assert data["count"] == 2000
    traces = analysis.curves.traces.high[:2000, torque["columns"][0]]
    np.testing.assert_allclose(values, traces, atol=packed["step"])


def test_the_event_is_in_table_and_plots(analysis, page):
    (event,) = analysis.events
    (shown,) = data_of(page)["events"]
    assert shown["segment"] == "base" and shown["from"] == pytest.approx(event.detected)
    assert page.count("data-event=") >= 1 and f"{event.detected:.3f}" in page


def test_the_description_is_in_the_page(page):
    for word in ("joint1", "from base", "polarity", "outboard", "gravity", "-9.81", "31.1"):
        assert word in page


def test_moments_ignore_what_is_not_known():
    moments = Moments(2)
    columns = np.array([[1.0, -3.0, 9.0], [np.nan, 2.0, 4.0]])
    used = np.array([[True, True, False]] * 2)
    moments += Moments.of(columns[:, :1], used[:, :1])
    moments += Moments.of(columns[:, 1:], used[:, 1:])
    np.testing.assert_allclose(moments.rms, [np.sqrt(5.0), 2.0])
    np.testing.assert_allclose(moments.mean, [-1.0, 2.0])
    np.testing.assert_allclose(moments.largest, [3.0, 2.0])
    nothing = Moments.of(columns, np.zeros((2, 3), bool))
    assert np.isnan([nothing.rms, nothing.mean, nothing.largest]).all()
    whole = Moments.of(columns[:1], np.ones((1, 3), bool))
    np.testing.assert_allclose([whole.mean[0], whole.largest[0]], [7.0 / 3.0, 9.0])


def test_a_page_without_room_says_what_was_left_out(analysis, monkeypatch):
    assert page_text(analysis).count('class="event-figure"') == len(analysis.events)
    monkeypatch.setattr("touchline.report.page.MOST_BYTES", 1000)
    small = page_text(analysis)
    assert "1 of 1 events have a figure" in small and "0 of them have plots" in small
    assert 'data-window="' not in small


def test_plots_are_there_without_the_script(analysis, page):
    static = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    drawn = re.findall(r'<path class="curve s\d[^"]*" d="M[^"]+"', static)
    panels = analysis.curves.on_page() + analysis.curves.event_panels("base")
    assert len(drawn) == sum(len(panel.curves) for panel in panels)
