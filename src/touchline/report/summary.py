# SPDX-License-Identifier: Apache-2.0
"""The summary of an analysis as text."""

from touchline.report.analysis import Analysis


def summary_text(analysis: Analysis) -> str:
    """What `touchline analyze` prints."""
    clock = analysis.statistics.clock
    lines = [f"{analysis.log.name}: {clock.duration:.2f} s, {clock.rows} samples"]
    for event in analysis.events:
        lines.append(str(event.as_json()))
    return "\n".join(lines)
