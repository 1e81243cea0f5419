# SPDX-License-Identifier: Apache-2.0
"""A figure per event: the arm from two sides, and the curves around it, within a page's budget."""

import json
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from html import escape

import numpy as np

from touchline.report.event_pictures import caption, event_pictures, event_scene, truth_of
from touchline.report.event_windows import Window
from touchline.report.facts import event_doubt
from touchline.report.html import note, section
from touchline.report.outcome import Analysis
from touchline.report.picture import SIGMAS
from touchline.report.plots import joined, plot
from touchline.report.render.skin import native_skin, robot_skin
from touchline.result.event import Event

MOST_PICTURED = 400  # events; two pictures take some 40 ms
# Up to so many events, the pictures are so wide [pixels].
FRAME = 400  # bytes around the pictures and plots of an event
PICTURES = ((16, 520), (80, 400), (MOST_PICTURED, 300))
PIECES = (512, 256, 128, 64, 32)  # of time in a plot, at most
PLOT = (500, 130)  # pixels


def figures(analysis: Analysis, room: int, threads: int) -> tuple[str, set[int]]:
    """The section with a figure per event, and the events that have one.

    Where there is no room for all, those that stood out least go without plots, then without
    pictures, and the section says so.

    Args:
        analysis: what the page is about.
        room: bytes that the section may take.
        threads: that may draw at a time.
    """
    events = _ranked(analysis)
    if not events:
        return "", set()
    shown = events[:MOST_PICTURED]
    pictures = _pictures(analysis, shown, threads)
    used = sum(map(len, pictures.values())) + FRAME * len(shown)
    plots, most = _plots(analysis, shown, room - used)
    drawn = [event for event in shown if event.id in pictures or event.id in plots]
    drawn.sort(key=lambda event: event.id)
    parts = [_figure(analysis, event, pictures, plots) for event in drawn]
    words = note(_words(analysis, len(drawn), pictures, plots, most))
    ids = {event.id for event in drawn}
    return section("The events", words, *parts, anchor="pictures") if parts else "", ids


def _ranked(analysis: Analysis) -> list[Event]:
    """All events, those that stand out most first: collisions, then by the largest test."""

    def strength(event: Event) -> tuple[bool, float]:
        window = analysis.windows.get(event)
        tests = [p for p in analysis.curves.event_panels(event.segment) if p.kind == "test"]
        if window is None or not tests:
            return event.level == "collision", 0.0
        high = window.of(tests[0].curves[0].column)[1]
        return event.level == "collision", float(np.fmax.reduce(high, initial=0.0))

    return sorted(analysis.events, key=strength, reverse=True)


def _pictures(analysis: Analysis, events: Sequence[Event], threads: int) -> dict[int, str]:
    """Two pictures of each event, by its number."""
    from tqdm import tqdm

    robot = analysis.robot
    posed = [(e, q) for e in events if (q := analysis.poses.get(e)) is not None]
    if not posed or not robot_skin(robot):
        return {}
    width = next(width for most, width in PICTURES if len(posed) <= most)

    def drawn(one: tuple[Event, np.ndarray]) -> tuple[int, str]:
        event, q = one
        scene = event_scene(robot, event, q, truth_of(event, analysis.comparisons))
        pair = event_pictures(scene, event, (width, 3 * width // 4))
        return event.id, f'<div class="views" style="--picture:{width}px">{pair}</div>'

    native_skin(robot)  # once, not in every thread
    with ThreadPoolExecutor(threads) as pool:  # nothing native is locked
        made = pool.map(drawn, posed)
        bar = tqdm(made, "pictures", len(posed), unit="event", disable=None, leave=False)
        return dict(bar)


def _plots(analysis: Analysis, events: Sequence[Event], room: int) -> tuple[dict[int, str], int]:
    """Plots by the number of the event, and how many pieces they have at most.

    As fine as there is room for all events, else as many as there is room for.
    """
    windows = [(event, w) for event in events if (w := analysis.windows.get(event)) is not None]
    made: dict[int, str] = {}
    most = PIECES[0]
    for most in PIECES:
        made, size = {}, 0
        for event, window in windows:
            text = _event_plots(analysis, event, window.coarser(most))
            size += len(text)
            if size > room:
                break
            made[event.id] = text
        if len(made) == len(windows):
            break
    return made, most


def _event_plots(analysis: Analysis, event: Event, window: Window) -> str:
    clock = analysis.statistics.clock
    first = analysis.curves.traces.start
    origin = analysis.origin
    span = (window.start - origin, window.start - origin + window.width * len(window.low))
    end = clock.last if event.cleared is None else event.cleared
    join = joined(window.width, analysis.period)
    shaded = [(event.detected - origin, end - origin, event.level)]
    parts = []
    for panel in analysis.curves.event_panels(event.segment):
        curves = [window.of(curve.column) for curve in panel.curves]
        data = {"segment": panel.segment or event.segment}
        parts.append(plot(panel, curves, span, shaded, PLOT, data, "", join))
    where = json.dumps([round(window.start - first, 6), round(window.width, 9), len(window.low)])
    return f'<div class="around" data-window="{where}">{"".join(parts)}</div>'


def _figure(
    analysis: Analysis, event: Event, pictures: dict[int, str], plots: dict[int, str]
) -> str:
    doubt = event_doubt(event)
    words = caption(event, analysis.origin) + (f". {doubt}" if doubt else "")
    return (
        f'<figure class="event-figure" id="event-{event.id}"><figcaption><b>{event.id}</b> '
        f"{escape(words)}</figcaption>"
        f"{pictures.get(event.id, '')}{plots.get(event.id, '')}</figure>"
    )


def _words(
    analysis: Analysis,
    drawn: int,
    pictures: dict[int, str],
    plots: dict[int, str],
    most: int,
) -> str:
    words = (
        "The arm as it stood at the event, from two sides. The arrow ends where the arm was "
        "touched and points along the force on it; the line goes on along the force. The disc is "
        f"{SIGMAS:g} standard deviations of the point wide; the ball hides a small one. "
        "What lies behind the arm is drawn fainter."
        if pictures
        else "No mesh of the robot could be read: there are no pictures."
    )
    if pictures and analysis.comparisons:
        words += " Violet is the truth of the simulation."
    words += " Below: the wrench on the segment, its largest test, and the joint torques."
    total = len(analysis.events)
    if min(drawn, len(plots)) < total:
        words += (
            f" To keep this page small, {drawn} of {total} events have a figure, those that "
            f"stood out most, and {len(plots)} of them have plots; touchline view shows them all."
        )
    if most < PIECES[0]:
        words += f" Their plots have at most {most} pieces of time."
    return words
