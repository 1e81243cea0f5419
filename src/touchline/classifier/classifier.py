# SPDX-License-Identifier: Apache-2.0
"""Contact or collision, and clamped or free: what kind of touch a segment feels.

What counts as a blow is said here; the native `classifier.hpp` follows the samples.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import IntEnum

import numpy as np

from touchline.arrays import Array
from touchline.classifier.zones import Zones
from touchline.detector.thresholds import RowThreshold, Thresholds
from touchline.model.robot import Robot
from touchline.native import core
from touchline.observer.observer import Estimate, Observer
from touchline.tuning import DEFAULTS

NOISE_RATIO = 2.0  # contact thresholds per window of the rate that noise may make


class Kind(IntEnum):
    """What is known of a touch."""

    NONE = 0
    UNDECIDED = 1
    CONTACT = 2
    COLLISION = 3


@dataclass(frozen=True)
class Classes:
    """The classifier's view of N samples.

    Attributes:
        kinds: (N, m) the `Kind` of each segment's touch.
        rates: (N, m) at which each segment's force grows [N/s]; NaN where not touched.
    """

    kinds: Array
    rates: Array


class Classifier:
    """Follows samples; the same in whatever parts they come.

    A collision begins with a force that grows faster than the zones' `onset` and than noise can, to
    more than the collision threshold.

    Args:
        observer: that makes the estimates.
        thresholds: of the detector.
        zones: of the robot.
    """

    def __init__(self, observer: Observer, thresholds: Thresholds, zones: Zones) -> None:
        limits = blow_limits(observer.robot, thresholds, zones)
        self.core = core.Classifier(observer.kernel, limits)

    def follow(self, time: Array, estimate: Estimate, levels: Array) -> Classes:
        """Takes N samples whose places are not asked for.

        Args:
            time: (N,) [s].
            estimate: of these samples.
            levels: (N, m) of the detection.
        """
        stamps = np.ascontiguousarray(time, dtype=float)
        return Classes(*self.core.follow(stamps, estimate.rows, levels))


def blow_limits(
    robot: Robot, thresholds: Thresholds, zones: Zones, tuning: Mapping[str, float] = DEFAULTS
) -> list[core.BlowLimits]:
    """From when on a touch is a blow, for each segment, in the words of the native core."""
    limits = []
    for g, segment in enumerate(robot.segment_names):
        rows = [row for row in thresholds.rows if row.segment == g]
        onset, collision = _blow(rows, tuning)
        torques = [row.joint for row in rows if row.joint >= 0] if segment == "root" else []
        limits.append(core.BlowLimits(max(zones.onset(segment), onset), collision, torques))
    return limits


def _blow(rows: Sequence[RowThreshold], tuning: Mapping[str, float]) -> tuple[float, float]:
    """The least rate [N/s] and force [N] of a blow that the rows of a segment let tell."""
    forces, unit = [row for row in rows if row.component in (0, 1, 2)], 1.0
    if not forces:
        forces, unit = [row for row in rows if row.joint >= 0], 1.0 / tuning["classifier.lever"]
    if not forces:
        return np.inf, np.inf
    noise = unit * max(row.contact for row in forces)
    onset = NOISE_RATIO * noise / tuning["classifier.rate_window"]
    return onset, unit * min(row.collision for row in forces)
