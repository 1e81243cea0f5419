# SPDX-License-Identifier: Apache-2.0
"""`report.html`: one file that needs nothing else, no network least of all."""

import base64
import json
from html import escape
from pathlib import Path
from typing import Any

import numpy as np

from touchline import __version__
from touchline.report.beside import Beside
from touchline.report.comparison import HEAD, cells, verdict
from touchline.report.curves import Panel
from touchline.report.event_figures import figures
from touchline.report.facts import (
    event_status,
    event_where,
    health_facts,
    joint_facts,
    segment_facts,
)
from touchline.report.html import Cell, note, section, table
from touchline.report.lanes import lanes
from touchline.report.outcome import Analysis
from touchline.report.outputs import strict
from touchline.report.plots import joined, plot
from touchline.report.robot_section import robot_section
from touchline.result.event import Event

MOST_EVENTS, MOST_SHADED = 1000, 5000
MOST_BYTES = 4_850_000  # of the page
STEPS = 32767
DRAWN = 400  # pieces of time of a plot without the script
BESIDE = "beside"  # the row of events of other results
PLOT = (1030, 120)  # pixels
HELP = (
    "Each point of a curve spans the least and the largest value of its piece of time. Drag over "
    "a plot to zoom in, with Shift to move; the wheel zooms a plot that was clicked; arrow keys, "
    "plus and minus do the same; double-click or 0 shows all. Events are shaded and numbered. "
    "CSV and PNG save what a plot shows. The address names the event or time shown: send it on."
)

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
  content="default-src 'none'; img-src data:; style-src 'unsafe-inline';
  script-src 'unsafe-inline'">
<title>{title}</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
<footer>Touchline {version}. Forces and torques are those on the robot; SI units; wrenches of
segments in world axes about the world origin. Not a certified safety function.</footer>
</main>
<script type="application/json" id="data">{data}</script>
<script>
{script}</script>
</body>
</html>
"""


def page_text(analysis: Analysis, figured: bool = True, threads: int = 1) -> str:
    """The whole page, or the page without a figure for each event; `threads` draw at a time."""
    assets = Path(__file__).parent / "assets"
    data = json.dumps(strict(_data(analysis)), allow_nan=False).replace("<", "\\u003c")
    style, script = ((assets / f"report.{kind}").read_text("utf-8") for kind in ("css", "js"))
    before = [_header(analysis), _warnings(analysis)]
    after = [_plots(analysis), _residuals(analysis), _health(analysis), robot_section(analysis)]
    fixed = [data, style, script, *before, *after, *_tables(analysis, set())]
    room = MOST_BYTES - sum(len(p.encode()) for p in fixed)
    shown, pictured = figures(analysis, room, threads) if figured else ("", set[int]())
    body = [*before, *_tables(analysis, pictured), shown, *after]
    return PAGE.format(
        title=escape(f"{analysis.log.name} - Touchline"),
        style=style,
        body="\n".join(body),
        version=__version__,
        data=data,
        script=script,
    )


def _tables(analysis: Analysis, pictured: set[int]) -> list[str]:
    return [_events(analysis, pictured), _comparisons(analysis), _faint(analysis)]


def _header(analysis: Analysis) -> str:
    statistics = analysis.statistics
    clock, events = statistics.clock, analysis.events
    collisions = sum(event.level == "collision" for event in events)
    healthy = 100 * statistics.healthy / max(clock.rows, 1)
    cards = [
        (f"{clock.duration:.2f} s", f"{clock.rows} samples"),
        (f"{1 / analysis.period:.4g} Hz", f"longest step {1e3 * clock.longest:.3g} ms"),
        (str(len(events)), f"events, {collisions} of them collisions"),
        (f"{healthy:.1f} %", "of the samples without remark"),
    ]
    boxes = "".join(f'<div class="card"><b>{a}</b><span>{b}</span></div>' for a, b in cards)
    return (
        f"<h1>{escape(analysis.log.name)}</h1>"
        f'<p class="soft">{escape(analysis.robot.name)}, observer method '
        f'{analysis.method}</p><div class="cards">{boxes}</div>'
    )


def _warnings(analysis: Analysis) -> str:
    if not analysis.warnings:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in analysis.warnings)
    return f'<div class="warnings"><ul>{items}</ul></div>'


def _events(analysis: Analysis, pictured: set[int]) -> str:
    events = analysis.events
    strip = (
        '<div class="plot screen" data-strip><svg role="img" viewBox="0 0 1030 60" '
        'aria-label="events over time"></svg></div>'
    )
    if not events:
        others = analysis.curves.beside is not None and analysis.curves.beside.events
        return section("Events", strip if others else "", "<p>None.</p>")
    head = ["", "detected [s]", "lasted [s]", "level", "segment", "force [N]", "torque [Nm]"]
    rows = [_event_row(e, analysis.origin, e.id in pictured) for e in events[:MOST_EVENTS]]
    marks = [f' data-event="{i}"' for i in range(len(rows))]
    hidden = len(events) - MOST_EVENTS
    words = "Peaks of force and of the torque on the named joint. A click shows the event."
    if hidden > 0:
        words += f" {hidden} more are in events.json."
    return section("Events", strip, table([*head, "where", "status"], rows, marks), note(words))


def _comparisons(analysis: Analysis) -> str:
    rows = analysis.comparisons
    if not rows:
        return ""
    words = f"{verdict(rows, analysis.events)}. The truth is the simulation's own."
    return section("Against the truth", table(HEAD, [cells(row) for row in rows]), note(words))


def _faint(analysis: Analysis) -> str:
    """Touches below what can be felt on their link."""
    if not analysis.faint:
        return ""
    items = "".join(f"<li>{escape(line)}</li>" for line in analysis.faint)
    return section("Below what can be felt", f"<ul>{items}</ul>")


def _event_row(event: Event, origin: float, pictured: bool) -> list[Any]:
    lasted = "to the end" if event.cleared is None else f"{event.cleared - event.detected:.3f}"
    peak = event.force_peak, event.torque_peak
    number = f'<a href="#event-{event.id}">{event.id}</a>' if pictured else str(event.id)
    return [
        Cell(number),
        f"{event.detected - origin:.3f}",
        lasted,
        Cell(f'<span class="level {event.level}">{event.level}</span>'),
        event.segment,
        *("" if value is None else f"{value:.2f}" for value in peak),
        event_where(event),
        event_status(event),
    ]


def _plots(analysis: Analysis) -> str:
    panels = list(enumerate(analysis.curves.on_page()))
    panels.sort(key=lambda pair: pair[1].kind != "test")  # the tests tell most, so they come first
    tools = (
        '<div class="tools"><button id="reset">whole recording</button><span id="shown"></span>'
        '<span id="at"></span></div>'
    )
    origin = analysis.origin
    since = f" Times count from {origin:.3f} s." if origin else ""
    words = (
        f"{HELP} The band is the slow baseline with the contact threshold on either side.{since}"
    )
    words += _beside_words(analysis)
    drawn = [(p.kind, _panel_plot(analysis, p, index)) for index, p in panels]
    logged = "".join(text for kind, text in drawn if kind == "signal")
    felt = "".join(text for kind, text in drawn if kind != "signal")
    parts = [note(words), tools, felt, "<h3>As logged</h3>", logged]
    return section("The whole recording", *parts, anchor="plots")


def _beside_words(analysis: Analysis) -> str:
    beside = analysis.curves.beside
    if beside is None:
        return ""
    name = escape(beside.name)
    words = f" Dashed curves, and the events in the row beside, are those of {name}."
    if beside.shift:
        words += f" {name} is shifted by {beside.shift:.3f} s: both begin together."
    return words


def _panel_plot(analysis: Analysis, panel: Panel, index: int) -> str:
    """A plot that shows the recording coarsely; the script draws it from all the data."""
    traces = analysis.curves.traces
    used = max(traces.used, 1)
    step = -(-used // DRAWN)
    starts = np.arange(0, used, step)
    curves = [
        (
            np.fmin.reduceat(traces.low[:used, curve.column], starts),
            np.fmax.reduceat(traces.high[:used, curve.column], starts),
        )
        for curve in panel.curves
    ]
    begin = traces.start - analysis.origin
    span = (begin, begin + len(starts) * step * traces.width)
    join = joined(step * traces.width, analysis.period)
    return plot(panel, curves, span, (), PLOT, None, f' data-panel="{index}"', join)


def _residuals(analysis: Analysis) -> str:
    robot, statistics, thresholds = analysis.robot, analysis.statistics, analysis.thresholds
    rows = [
        [j.name, *_digits(j.rms, j.quiet_rms, j.mean, j.largest, j.threshold)]
        for j in joint_facts(robot, statistics, thresholds)
    ]
    head = ["joint", "RMS", "RMS without contact", "mean", "largest", "contact threshold"]
    parts = ["<h3>External joint torques [Nm]</h3>", table(head, rows)]
    segments = segment_facts(robot, statistics, thresholds)
    if segments:
        rows = [
            [
                s.name,
                *_digits(
                    s.force_rms,
                    s.quiet_force_rms,
                    s.force_threshold,
                    s.moment_rms,
                    s.quiet_moment_rms,
                    s.moment_threshold,
                ),
            ]
            for s in segments
        ]
        head = [
            "segment",
            "force RMS [N]",
            "without contact",
            "threshold",
            "moment RMS [Nm]",
            "without contact",
            "threshold",
        ]
        parts += ["<h3>External wrenches of segments</h3>", table(head, rows)]
        parts.append(
            note(
                "Moments about the world origin; thresholds are those in the frame of "
                "the segment's sensor, about its origin."
            )
        )
    words = (
        "Settled samples only. While nothing touches, what is left is the model's error and noise."
    )
    return section("Residuals", *parts, note(words))


def _digits(*values: float | None) -> list[str]:
    return ["" if v is None or not np.isfinite(v) else f"{v:.3f}" for v in values]


def _health(analysis: Analysis) -> str:
    rows = list(health_facts(analysis.statistics))
    if not rows:
        return section("Health", "<p>No sample with a remark.</p>")
    return section("Health", table(["bit", "samples", "meaning"], rows))


def _data(analysis: Analysis) -> dict[str, Any]:
    traces = analysis.curves.traces
    used, start = traces.used, traces.start
    end = start + used * traces.width
    columns = range(traces.low.shape[1])
    events = analysis.events[:MOST_SHADED]
    ends = [(end if event.cleared is None else event.cleared) for event in events]
    bars = [(e.segment, e.detected, last) for e, last in zip(events, ends, strict=True)]
    return {
        "start": start,
        "origin": analysis.origin,
        "width": traces.width,
        "period": analysis.period,
        "count": used,
        "curves": [_packed(traces.low[:used, i], traces.high[:used, i]) for i in columns],
        "panels": [_panel_data(panel) for panel in analysis.curves.on_page()],
        "segments": [*analysis.robot.segment_names, *([BESIDE] if analysis.curves.beside else [])],
        "events": [
            {
                "id": event.id,
                "segment": event.segment,
                "level": event.level,
                "from": event.detected - start,
                "to": last - start,
                "lane": lane,
                "title": f"{event.id}: {event.level}, {event_where(event) or event.segment}",
            }
            for event, last, lane in zip(events, ends, lanes(bars), strict=True)
        ]
        + _beside_events(analysis.curves.beside, start, end),
    }


def _beside_events(beside: Beside | None, start: float, end: float) -> list[dict[str, Any]]:
    """Events of other results, in a row of their own."""
    if beside is None:
        return []
    events = beside.events[:MOST_SHADED]
    begins = [event["detected"] + beside.shift for event in events]
    cleared = [event["cleared"] for event in events]
    ends = [end if at is None else at + beside.shift for at in cleared]
    bars = [(BESIDE, begin, last) for begin, last in zip(begins, ends, strict=True)]
    return [
        {
            "id": event["id"],
            "segment": BESIDE,
            "beside": True,
            "level": event["level"],
            "from": begin - start,
            "to": last - start,
            "lane": lane,
            "title": f"{beside.name}, {event['id']}: {event['level']}, {event['segment']}",
        }
        for event, (_, begin, last), lane in zip(events, bars, lanes(bars), strict=True)
    ]


def _panel_data(panel: Panel) -> dict[str, Any]:
    return {
        "segment": panel.segment,
        "columns": [curve.column for curve in panel.curves],
        "band": panel.band,
        "limit": panel.limit,
    }


def _packed(low: np.ndarray, high: np.ndarray) -> dict[str, Any]:
    """A curve in 16 bits a value: middle + step * number, the smallest number standing for NaN."""
    least, largest = np.fmin.reduce(low, initial=np.inf), np.fmax.reduce(high, initial=-np.inf)
    if least > largest:
        least = largest = 0.0
    middle, half = 0.5 * (least + largest), 0.5 * (largest - least)
    step = half / STEPS if half > 0 else 1.0

    def pack(values: np.ndarray) -> str:
        numbers = np.where(np.isfinite(values), np.round((values - middle) / step), -STEPS - 1)
        return base64.b64encode(numbers.astype("<i2").tobytes()).decode("ascii")

    return {"middle": float(middle), "step": float(step), "low": pack(low), "high": pack(high)}
