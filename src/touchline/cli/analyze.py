# SPDX-License-Identifier: Apache-2.0
"""`touchline analyze`."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg


def analyze(
    log: Annotated[Positional[Path], arg(metavar="LOG")],
    /,
    robot: Annotated[str, arg(metavar="ROBOT")],
    out: Annotated[Path, arg(metavar="DIR")],
    bandwidth: Annotated[float | None, arg(metavar="K")] = None,
    method: Literal["segment", "paper"] = "segment",
    report: Literal["full", "summary", "none"] = "full",
) -> int:
    """Estimates external torques and wrenches in a recording and finds the contacts in it.

    Example: touchline analyze run1.parquet --robot robot.yaml --out results

    Writes into DIR estimates.parquet (a row per sample), contacts.parquet (a row per contact and
    sample), events.json (a list of contacts from beginning to end) and report.html (open it in a
    browser; it needs no network); and for `touchline view DIR` analysis.json (what the results were
    made from) and postures.parquet (joint positions, at most 100 a second). Prints a summary.
    Older results in DIR are replaced when the new ones are whole; other files in it are left alone.
    If it is stopped, the older results stand, and what was finished of the new ones is in the
    folder touchline.unfinished: events.json, and estimates.parts and contacts.parts with Parquet
    files.

    Args:
        log: The recording: a table (.parquet, .csv, .csv.gz) or a rosbag2 (.mcap, .db3, or its
            folder). Foreign column names are given in the robot description, key `log`.
        robot: Its robot.yaml, or the name of a robot that ships with Touchline (sara).
        out: Directory for the results.
        bandwidth: Of the observer [rad/s]: higher is faster and noisier. Default: as described.
        method: segment: each segment's own momentum, no ghost contacts in motion; paper: each
            residual in its sensor's frame, as published.
        report: full; summary: without pictures and curves of each event; none: no report.html.
    """
    from touchline.report.analysis import analyze as run
    from touchline.report.summary import summary_text

    analysis = run(log, robot, out, bandwidth, method, report)
    print(summary_text(analysis))
    return 0
