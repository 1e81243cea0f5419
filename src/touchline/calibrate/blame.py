# SPDX-License-Identifier: Apache-2.0
"""What stands out when something seems to touch the robot: which row, and what its joint does."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from touchline.calibrate.quiet import Suspicion
from touchline.detector.calibration import Residuals, watching, with_methods
from touchline.detector.detector import Detector
from touchline.detector.thresholds import make_thresholds, row_name
from touchline.model.description import LevelDescription, RowCalibration
from touchline.model.robot import Robot
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples

STILL = 0.01  # rad/s; slower joints stand still
FAR, OFTEN = 6.0, 0.06  # robust sigmas, and the share of the time that is spent beyond them


@dataclass(frozen=True)
class Blame:
    """The row that stands out most in a suspicious stretch.

    Attributes:
        row: its name.
        unit: "N" or "Nm".
        off: largest residual less its offset [N or Nm].
        usual: root mean square over all recordings [N or Nm].
        speed: (2,) least and greatest velocity of its joint [rad/s]; None for a sensor's row.
    """

    row: str
    unit: str
    off: float
    usual: float
    speed: tuple[float, float] | None

    def __str__(self) -> str:
        text = f"{self.row} is {self.off:.3g} {self.unit} off, usually {self.usual:.2g} {self.unit}"
        if self.speed is None:
            return text
        low, high = self.speed
        fastest = max(-low, high)
        if fastest < STILL:
            return f"{text}; the joint stands still"
        if low < 0.0 < high:
            return f"{text}; the joint reverses (friction?)"
        return f"{text}; the joint moves at up to {fastest:.2g} rad/s"


def find_blame(
    robot: Robot,
    period: float,
    rows: dict[str, RowCalibration],
    recording: Iterable[Samples],
    suspicion: Suspicion,
) -> Blame | None:
    """Reads a recording once more, for the row that stands out in a stretch of it."""
    robot = with_methods(robot, "rows")
    thresholds = watching(robot, period, rows)
    wide = tuple(replace(row, baseline_limit=1e9) for row in thresholds.rows)
    detector = Detector(Observer(robot), replace(thresholds, rows=wide), period)
    typical = np.array([row.contact for row in wide])
    own = np.array([row.segment == suspicion.segment for row in wide])
    largest, speeds = np.zeros(len(wide)), []
    for s in recording:
        residual = detector.details(s.time, s.q, s.qd, s.tau, s.wrench).residual
        inside = (s.time >= suspicion.start) & (s.time <= suspicion.end)
        if inside.any():
            size = np.abs(np.nan_to_num(residual[inside])).max(axis=0)
            largest = np.maximum(largest, np.where(own, size, 0.0))
            speeds.append(s.qd[inside])
    if not largest.any():
        return None
    worst = int(np.argmax(largest / typical))
    row, speed = wide[worst], None
    if row.component < 0:
        qd = np.concatenate(speeds)[:, row.joint]
        speed = float(np.nanmin(qd)), float(np.nanmax(qd))
    unit = "N" if 0 <= row.component < 3 else "Nm"
    return Blame(row_name(robot, row), unit, float(largest[worst]), float(typical[worst]), speed)


def often_off(robot: Robot, period: float, found: Residuals) -> list[str]:
    """Rows that are far off again and again, as those of a robot that is touched throughout.

    Errors of a model scatter about nothing; contacts make a second population. On recordings of a
    Panda that was touched half of the time 9 to 38 % of the residuals of some joint lie so far out.
    Of a UR10 with friction in its torques it is 4.5 %. What would be no contact without a
    calibration is none: after a touch dry friction leaves an offset.
    """
    told = []
    plain = with_methods(robot, "rows", contact=LevelDescription(), calibration=None)
    for i, row in enumerate(make_thresholds(plain, period).rows):
        size = np.abs(found.residual[:, i])
        size = size[np.isfinite(size)]
        if not len(size):
            continue
        limit = max(FAR * 1.4826 * float(np.median(size)), row.contact)
        share = float(np.mean(size > limit))
        if share > OFTEN:
            unit = "N" if 0 <= row.component < 3 else "Nm"
            told.append(f"{row_name(robot, row)} is more than {limit:.2g} {unit} off ")
            told[-1] += f"for {100 * share:.0f} % of the time"
    return told
