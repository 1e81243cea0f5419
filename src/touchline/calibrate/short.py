# SPDX-License-Identifier: Apache-2.0
"""Thresholds from recordings too short to show how often something is exceeded.

The largest residual that was seen is taken for one that comes once in so long a recording, and the
tail beyond it for that of normal values, whose mean excess over k sigma is sigma / k.
"""

from collections.abc import Iterable

import numpy as np

from touchline.detector.calibration import collect_residuals, fit_rows
from touchline.detector.thresholds import make_thresholds, row_name
from touchline.model.description import CalibrationDescription, TailDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

METHOD = "rows"  # of detection, the one whose statistic is a row's residual


def short_thresholds(
    robot: Robot,
    period: float,
    seconds: float,
    recordings: Iterable[Iterable[Samples]],
    optimism: float,
) -> CalibrationDescription | None:
    """Row thresholds; None where too little settles even for these.

    Args:
        robot: as identified, with its noise figures.
        period: of the samples [s].
        seconds: of the recordings.
        recordings: that played a part in the identification.
        optimism: how much larger residuals are on data that played none, at least 1.
    """
    found = collect_residuals(robot, period, recordings)
    rows = fit_rows(robot, period, found)
    largest: dict[str, float] = {}
    for i, row in enumerate(make_thresholds(robot, period).rows):
        name = row_name(robot, row)
        if name in rows:
            size = float(np.nanmax(np.abs(found.residual[:, i]))) / rows[name].typical
            segment = robot.segment_names[row.segment]
            largest[segment] = max(largest.get(segment, 1.0), size)
    if not largest:
        return None
    hours = seconds / 3600.0
    tails = {
        segment: {METHOD: TailDescription(optimism * k, 1.0 / hours, optimism / k)}
        for segment, k in largest.items()
    }
    return CalibrationDescription(hours, period, rows, tails)
