# SPDX-License-Identifier: Apache-2.0
"""`touchline calibrate`."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

Method = Literal["rows", "scaled", "chi2", "glrt", "cusum"]


def calibrate(
    logs: Annotated[Positional[tuple[Path, ...]], arg(metavar="LOG [LOG ...]")],
    /,
    robot: Annotated[str, arg(metavar="ROBOT")],
    out: Annotated[Path, arg(metavar="ROBOT")],
    method: tuple[Method, ...] = (),
    false_alarms: Annotated[float | None, arg(metavar="PER_HOUR")] = None,
    trust: bool = False,
    figure: Annotated[Path | None, arg(metavar="FILE")] = None,
) -> int:
    """Finds noise figures and detection thresholds in recordings without contact.

    Example: touchline calibrate free1.parquet free2.parquet --robot robot.yaml --out robot.yaml

    Move the robot as it will move at work, touch nothing, and record: half an hour is good, several
    recordings are better than one. Writes ROBOT anew with the keys noise and detection; all other
    keys and comments stay. The thresholds hold for the sample rate of the recordings. Prints the
    rate of false alarms that is reached on data held out.

    Recordings in which something seems to touch the robot are refused, with the times, the row that
    stands out and what its joint did.

    Args:
        logs: Recordings of contact-free motion: tables (.parquet, .csv, .csv.gz) or rosbag2.
        robot: The robot.yaml, or the name of a robot that ships with Touchline (sara).
        out: The new robot.yaml; may be the same file.
        method: Of detection: rows (a threshold per row), scaled (which grows with speed and
            acceleration), chi2 (all rows of a segment together), glrt (of several windows of the
            unfiltered loads; quick), cusum (of innovations; quick). Several may be named; an event
            begins when one of them fires. Default: as described.
        false_alarms: Per hour of the whole robot. Default: as described, or 1.
        trust: Nothing touched the robot: what stands out is friction or the like, and counts.
        figure: Draws how often which statistic was exceeded, with the thresholds (.svg, .png).
    """
    from touchline.calibrate.run import calibrate as run
    from touchline.calibrate.summary import summary_text

    if figure is not None:
        from touchline.calibrate.figure import check_figure

        check_figure(figure)
    result = run(list(logs), robot, out, method, false_alarms, trust)
    print(summary_text(result))
    if figure is not None:
        from touchline.calibrate.figure import draw_calibration

        draw_calibration(result, figure)
        print(f"drawn:   {figure}")
    return 0
