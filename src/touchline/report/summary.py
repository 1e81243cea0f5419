# SPDX-License-Identifier: Apache-2.0
"""The summary of an analysis as text."""

import numpy as np

from touchline.report.facts import (
    detection_fact,
    event_place,
    health_facts,
    joint_facts,
    segment_facts,
)
from touchline.report.outcome import Analysis
from touchline.report.outputs import CONTACTS, ESTIMATES, EVENTS, REPORT

MOST_EVENTS = 40


def table(rows: list[list[str]], indent: str = "  ", right: bool = True) -> list[str]:
    """Lines of columns as wide as they must be; the first column is on the left."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    lines = []
    for row in rows:
        cells = [
            cell.rjust(width) if right and i else cell.ljust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ]
        lines.append((indent + "  ".join(cells)).rstrip())
    return lines


def number(value: float | None, digits: int = 2) -> str:
    """The number, `-` where there is none."""
    return "-" if value is None or not np.isfinite(value) else f"{value:.{digits}f}"


def summary_text(analysis: Analysis) -> str:
    """What `touchline analyze` prints."""
    parts = [
        _recording(analysis),
        _health(analysis),
        _events(analysis),
        [f"faint: {line}" for line in analysis.faint],
        _residuals(analysis),
        _warnings(analysis),
        _results(analysis),
    ]
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


def _recording(analysis: Analysis) -> list[str]:
    clock = analysis.statistics.clock
    return [
        f"{analysis.log.name} with {analysis.robot.name}: {clock.duration:.2f} s, "
        f"{clock.rows} samples, {1 / analysis.period:.4g} Hz, longest step "
        f"{1e3 * clock.longest:.3g} ms"
    ]


def _health(analysis: Analysis) -> list[str]:
    statistics = analysis.statistics
    rows = [[name, str(count), meaning] for name, count, meaning in health_facts(statistics)]
    share = statistics.healthy / max(statistics.clock.rows, 1)
    return [f"health: {100 * share:.1f} % of the samples without remark", *table(rows, right=False)]


def _events(analysis: Analysis) -> list[str]:
    events = analysis.events
    head = f"detection: {detection_fact(analysis.robot, analysis.thresholds)}"
    if not events:
        return [head, "events: none"]
    rows = [["event", "detected", "lasted", "level", "segment", "force", "torque", "where"]]
    for event in events[:MOST_EVENTS]:
        lasted = "on" if event.cleared is None else number(event.cleared - event.detected)
        rows.append(
            [
                str(event.id),
                f"{event.detected:.3f}",
                lasted,
                event.level,
                event.segment,
                number(event.force_peak, 1),
                number(event.torque_peak, 1),
                event_place(event),
            ]
        )
    hidden = len(events) - MOST_EVENTS
    more = [f"  ... and {hidden} more in events.json"] if hidden > 0 else []
    return [head, f"events: {len(events)} (times in s, peaks in N and Nm)", *table(rows), *more]


def _residuals(analysis: Analysis) -> list[str]:
    robot, statistics = analysis.robot, analysis.statistics
    rows = [["external torque [Nm]", "RMS", "without contact", "mean", "largest", "threshold"]]
    for joint in joint_facts(robot, statistics, analysis.thresholds):
        values = (joint.rms, joint.quiet_rms, joint.mean, joint.largest, joint.threshold)
        rows.append([joint.name, *(number(value, 3) for value in values)])
    lines = table(rows, indent="") if robot.joint_names else []
    segments = segment_facts(robot, statistics, analysis.thresholds)
    if segments:
        head = ["external wrench", "RMS [N]", "without contact", "RMS [Nm]", "without contact"]
        rows = [head]
        for segment in segments:
            forces = (segment.force_rms, segment.quiet_force_rms)
            moments = (segment.moment_rms, segment.quiet_moment_rms)
            rows.append([segment.name, *(number(value, 3) for value in (*forces, *moments))])
        lines += [*[""][: len(lines)], *table(rows, indent="")]
    return lines


def _warnings(analysis: Analysis) -> list[str]:
    return [f"note: {warning}" for warning in analysis.warnings]


def _results(analysis: Analysis) -> list[str]:
    page = [REPORT] if analysis.report != "none" else []
    return [f"results: {analysis.out}/" + ", ".join([*page, ESTIMATES, CONTACTS, EVENTS])]
