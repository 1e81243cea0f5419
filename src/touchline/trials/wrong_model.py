# SPDX-License-Identifier: Apache-2.0
"""Arms whose inertias are not as the model says, calibrated on their own motion without contact.

Every so many runs have an arm of their own. Each is calibrated as by `touchline calibrate`, with
or without `--no-identify`: on minutes of random motion within its joint limits, with the sensors
and the noise of the benchmark.
"""

from collections.abc import Callable, Iterable
from functools import lru_cache

from touchline.calibrate.run import growth
from touchline.detector import calibration as cal
from touchline.identify.described import identified_robot
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import (
    MotionMaker,
    generator,
    imperfect,
    random_trajectory,
)

RUNS = 25  # that share an arm
MINUTES = 6  # of motion, in recordings of one minute
RATE = 1000.0  # Hz


@lru_cache(maxsize=4)
def wrong_model(
    arm: str, tier: int, error: float, number: int, identified: bool = False
) -> tuple[Robot, Robot]:
    """An arm as described, and as it is.

    Args:
        arm: its name.
        tier: of noise.
        error: 1 sigma of the relative errors of masses and inertias (see `imperfect`).
        number: of the arm: each has errors of its own.
        identified: whether inertias are calibrated, too, or thresholds alone.

    Returns:
        The robot with the model as it stands in its file, calibrated, and the robot that moves.
    """
    robot = load_arm(arm, tier)
    real = imperfect(robot, error, 1000 + number)
    maker = MotionMaker(robot, real, RATE)

    def recordings():
        for minute in range(MINUTES):
            rng = generator(number, minute)
            yield [maker.samples(random_trajectory(robot, rng), rng)]

    if not identified:
        return with_thresholds(robot, recordings, {}), real
    found = identify(gather(robot, recordings()))
    return with_thresholds(identified_robot(found), recordings, growth(found)), real


def with_thresholds(
    robot: Robot, recordings: Callable[[], Iterable[Iterable[Samples]]], elsewhere: dict[str, float]
) -> Robot:
    """The robot with thresholds from motion without contact.

    Args:
        robot: as identified.
        recordings: makes them, twice.
        elsewhere: by row, how much larger residuals are on motion that played no part.
    """
    period, methods = 1.0 / RATE, robot.description.detection.method
    rows = cal.fit_rows(robot, period, cal.collect_residuals(robot, period, recordings()))
    robot = cal.with_methods(robot, *methods, min_duration=0.0)
    found = cal.collect_statistics(robot, period, rows, recordings(), methods)
    tails = cal.fit_tails(robot, found, methods)
    rows = cal.grown(rows, elsewhere)
    return cal.with_calibration(robot, cal.describe(found.hours, period, rows, tails))
