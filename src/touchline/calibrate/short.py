# SPDX-License-Identifier: Apache-2.0
"""Thresholds from recordings too short to show how often something is exceeded.

The level that one residual of a hundred exceeds is measured; beyond it the tail is taken for that
of normal values, whose mean excess over k sigma is sigma / k. Single outliers, which a start or a
late sample makes, do not raise it.
"""

from collections.abc import Iterable

import numpy as np

from touchline.detector.calibration import collect_residuals, fit_rows, grown
from touchline.detector.thresholds import make_thresholds, row_name
from touchline.model.description import CalibrationDescription, TailDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

METHOD = "rows"  # of detection, the one whose statistic is a row's residual
SHARE = 0.01  # of the residuals lie beyond the measured level
CORRELATED = 0.1  # s; residuals of a model's errors that are nearer than that are one excursion


def short_thresholds(
    robot: Robot,
    period: float,
    seconds: float,
    recordings: Iterable[Iterable[Samples]],
    growth: dict[str, float],
) -> CalibrationDescription | None:
    """Row thresholds; None where too little settles even for these.

    Args:
        robot: as identified, with its noise figures.
        period: of the samples [s].
        seconds: of the recordings.
        recordings: that played a part in the identification.
        growth: by row, how much larger residuals are on data that played none, at least 1.
    """
    found = collect_residuals(robot, period, recordings)
    rows = fit_rows(robot, period, found)
    levels: dict[str, float] = {}
    for i, row in enumerate(make_thresholds(robot, period).rows):
        name = row_name(robot, row)
        if name in rows:
            size = np.abs(found.residual[:, i])
            level = float(np.nanquantile(size, 1.0 - SHARE)) / rows[name].typical
            segment = robot.segment_names[row.segment]
            levels[segment] = max(levels.get(segment, 1.0), level)
    if not levels:
        return None
    rows = grown(rows, growth)
    often = SHARE * 3600.0 / CORRELATED
    tails = {
        segment: {METHOD: TailDescription(level, often, 1.0 / level)}
        for segment, level in levels.items()
    }
    return CalibrationDescription(seconds / 3600.0, period, rows, tails)
