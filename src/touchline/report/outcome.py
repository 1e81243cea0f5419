# SPDX-License-Identifier: Apache-2.0
"""What came out of a recording, for the pages that show it."""

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from touchline.detector.thresholds import Thresholds
from touchline.model.robot import Robot
from touchline.report.comparison import Comparison
from touchline.report.curves import Curves
from touchline.report.event_pictures import EventPoses
from touchline.report.event_windows import EventWindows
from touchline.report.statistics import Statistics
from touchline.result.event import Event
from touchline.result.standing import Standing

Report = Literal["full", "summary", "none"]

EPOCH = 1e6  # s; stamps beyond it are dates


@dataclass(frozen=True)
class Analysis:
    """What came out of a recording.

    Attributes:
        robot: the robot.
        log: path of the recording.
        out: directory with the results.
        method: of the observer.
        bandwidth: that overrides the description's [rad/s], or None.
        period: median time between the first samples [s].
        thresholds: of the detection.
        statistics: of all samples.
        curves: for plots; without traces where there is no page.
        events: all events.
        poses: how the robot stood at each of them; none where there is no page.
        windows: the curves around them; none where there is no page.
        comparisons: of the events with the truth of a simulated log.
        standing: what stood on the arm without a touch, and its noise.
        faint: touches, true or felt, that lie below what can be felt on their link, a line each.
        report: which page there is: "full", "summary" or "none".
        warnings: what the user should know.
        losses: those that tell of parts of the recording that could not be read.
    """

    robot: Robot
    log: Path
    out: Path
    method: str
    bandwidth: float | None
    period: float
    thresholds: Thresholds
    statistics: Statistics
    curves: Curves
    events: list[Event]
    poses: EventPoses
    windows: EventWindows
    comparisons: list[Comparison]
    standing: tuple[Standing, ...]
    faint: list[str]
    report: Report
    warnings: list[str]
    losses: list[str]

    @property
    def origin(self) -> float:
        """From where the report counts time [s]: 0, or the first sample where stamps are dates."""
        first = self.statistics.clock.first
        return first if abs(first) > EPOCH else 0.0
