# SPDX-License-Identifier: Apache-2.0
"""`fleet.html`: what all recordings have in common, and the way to the report of each."""

from collections import Counter, defaultdict
from html import escape
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np

import touchline
from touchline import __version__
from touchline.fleet.figures import EDGES, Figures, percentile
from touchline.fleet.manifest import Row
from touchline.fleet.tables import SHARES, Rows
from touchline.numbers import lasting
from touchline.report.html import Cell, note, section, table
from touchline.report.outputs import EVENTS, REPORT, write_text

PAGE_FILE = "fleet.html"
DRIFTS = 30  # joints that the page names, the worst first
HOURS = "Hour of the day in UTC; of a recording without dates, hours since its first sample."
MOST_FAINT = 20  # lines
MOST_RECORDINGS = 20_000  # lines of the last table: some 4 MB

PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy"
  content="default-src 'none'; style-src 'unsafe-inline'">
<title>Recordings - Touchline</title>
<style>
{style}</style>
</head>
<body>
<main>
{body}
<footer>Touchline {version}. Not a certified safety function.</footer>
</main>
</body>
</html>
"""


def write_page(out: Path, recordings: list[Row], figures: dict[str, Figures], rows: Rows) -> None:
    """Write the page in one step."""
    style = (Path(touchline.__file__).parent / "report" / "assets" / "report.css").read_text(
        "utf-8"
    )
    body = [
        _header(recordings),
        _robots(recordings, figures),
        _by(rows, "link", "Contacts by link", "link"),
        _by(rows, "hour", "Contacts by hour", "hour", note(HOURS)),
        _faint(recordings),
        _drift(figures),
        _health(rows),
        _recordings(out, recordings),
    ]
    text = PAGE.format(style=style, body="\n".join(body), version=__version__)
    write_text(out / PAGE_FILE, text)


def _header(recordings: list[Row]) -> str:
    told = Counter(row["status"] for row in recordings)
    seconds = sum(row["duration"] for row in recordings)
    lost = len(recordings) - told["ok"]
    cards = [
        (str(len(recordings)), f"recording{'s' * (len(recordings) != 1)}, {lost} of them not ok"),
        (lasting(seconds), f"{sum(row['samples'] for row in recordings)} samples"),
        (str(sum(row["events"] for row in recordings)), "contacts"),
        (str(sum(row["collisions"] for row in recordings)), "of them collisions"),
    ]
    boxes = "".join(f'<div class="card"><b>{a}</b><span>{b}</span></div>' for a, b in cards)
    return f'<h1>Recordings</h1><div class="cards">{boxes}</div>'


def _robots(recordings: list[Row], figures: dict[str, Figures]) -> str:
    hours, contacts, collisions = Counter[str](), Counter[str](), Counter[str]()
    names: dict[str, int] = Counter(f["robot"] for f in figures.values())
    spread: dict[str, Any] = defaultdict(lambda: np.zeros(len(EDGES) + 1, dtype=np.int64))
    for row in recordings:
        if row["name"] not in figures:
            continue
        robot = figures[row["name"]]["robot"]
        hours[robot] += row["duration"] / 3600
        contacts[robot] += row["events"]
        collisions[robot] += row["collisions"]
        for entry in figures[row["name"]]["hours"].values():
            for told in entry["segments"].values():
                spread[robot] += np.array(told["counts"])
    head = ["robot", "recordings", "hours", "contacts", "collisions", "contacts per hour"]
    head += [f"{name} [N]" for name in SHARES]
    words = (
        f"{', '.join(SHARES)}: percentiles of the force that is felt while nothing touches, in "
        "samples without remark."
    )
    lines = [
        [name, names[name], hours[name], contacts[name], collisions[name]]
        + [contacts[name] / hours[name] if hours[name] else None]
        + [percentile(spread[name], share) for share in SHARES.values()]
        for name in sorted(names)
    ]
    return section("Robots", table(head, [_short(line) for line in lines]), note(words))


def _faint(recordings: list[Row]) -> str:
    """Touches below what is surely felt on their link, by recording."""
    lines = [(row["name"], line) for row in recordings for line in row.get("faint", ())]
    if not lines:
        return ""
    items = [f"<li>{escape(name)}: {escape(line)}</li>" for name, line in lines[:MOST_FAINT]]
    if len(lines) > MOST_FAINT:
        items.append(f"<li>{len(lines) - MOST_FAINT} more are in manifest.jsonl</li>")
    return section("Below what can be felt", f"<ul>{''.join(items)}</ul>")


def _by(rows: Rows, key: str, title: str, head: str, words: str = "") -> str:
    groups: dict[tuple[str, Any], Counter[str]] = defaultdict(Counter)
    forces: dict[tuple[str, Any], float] = defaultdict(float)
    for row in rows["contacts"]:
        group = (row["robot"], row[key])
        groups[group][row["level"]] += 1
        forces[group] = max(forces[group], row["force_peak"] or 0.0)
    lines = [
        [robot, "not known" if value is None else value, sum(told.values()), told["collision"]]
        + [forces[robot, value] or None]
        for (robot, value), told in sorted(groups.items(), key=lambda item: (str(item[0]),))
    ]
    names = ["robot", head, "contacts", "collisions", "largest force [N]"]
    shown = table(names, [_short(line) for line in lines]) if lines else "<p>None.</p>"
    return section(title, shown, words)


def _drift(figures: dict[str, Figures]) -> str:
    """Mean torque felt while nothing touches, in the first recording and in the last."""
    means: dict[tuple[str, str], list[tuple[float, str, float]]] = defaultdict(list)
    for name, told in figures.items():
        total: dict[str, list[float]] = defaultdict(lambda: [0.0, 0.0])
        for entry in told["hours"].values():
            for joint, sums in entry["joints"].items():
                total[joint][0] += sums["sum"]
                total[joint][1] += sums["quiet"]
        for joint, (sum_, count) in total.items():
            if count:
                means[told["robot"], joint].append((told["first"] or 0.0, name, sum_ / count))
    lines = []
    for (robot, joint), found in means.items():
        found.sort()
        values = [mean for _, _, mean in found]
        lines.append([robot, joint, len(values), values[0], values[-1], values[-1] - values[0]])
        lines[-1].append(max(values) - min(values))
    lines.sort(key=lambda line: -abs(line[-1]))
    head = ["robot", "joint", "recordings", "first [Nm]", "last [Nm]", "change [Nm]", "span [Nm]"]
    words = (
        "Mean external torque without contact, per recording, in the order of their stamps. A span "
        f"that grows tells of drifting sensors or a changed load. The {DRIFTS} widest are shown."
    )
    shown = table(head, [_short(line) for line in lines[:DRIFTS]]) if lines else "<p>None.</p>"
    return section("Calibration drift", shown, note(words))


def _health(rows: Rows) -> str:
    totals: dict[str, Counter[str]] = defaultdict(Counter)
    for row in rows["health"]:
        for key, value in row.items():
            if isinstance(value, int) and key != "hour":
                totals[row["robot"]][key] += value
    met = {key for told in totals.values() for key, count in told.items() if count}
    bits = sorted(met - {"samples", "healthy"})
    lines = [
        [robot, 100.0 * told["healthy"] / max(told["samples"], 1), *(told[bit] for bit in bits)]
        for robot, told in sorted(totals.items())
    ]
    head = ["robot", "without remark [%]", *(bit.lower().replace("_", " ") for bit in bits)]
    words = note("Samples with each remark; remarks that no sample has are left out.")
    return section("Health of the samples", table(head, [_short(line) for line in lines]), words)


def _recordings(out: Path, recordings: list[Row]) -> str:
    lines = []
    for row in recordings[:MOST_RECORDINGS]:
        name = row["name"]
        file = next((f for f in (REPORT, EVENTS) if (out / name / f).is_file()), None)
        shown = escape(name)
        if file is not None:
            shown = f'<a href="{quote(f"{name}/{file}")}">{shown}</a>'
        lines.append(
            [Cell(shown), row["status"], row["robot"], row["duration"] / 60, row["events"]]
            + [row["collisions"], row["reason"]]
        )
    head = ["recording", "status", "robot", "minutes", "contacts", "collisions", "why"]
    hidden = len(recordings) - len(lines)
    more = note(f"{hidden} more are in manifest.jsonl.") if hidden else ""
    return section("Recordings", table(head, [_short(line) for line in lines]), more)


def _short(line: list[Any]) -> list[Any]:
    """Four digits, and no more than four decimals: what is smaller is noise."""
    return [round(float(f"{x:.4g}"), 4) + 0.0 if isinstance(x, float) else x for x in line]
