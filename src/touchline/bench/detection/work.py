# SPDX-License-Identifier: Apache-2.0
"""The long computations of the detection benchmark, cut into pieces for all cores."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.bench.detection.pushes import AFTER, BEFORE, PushMaker, random_pushes
from touchline.detector import calibration as cal
from touchline.detector.detector import Detector
from touchline.model.description import RowCalibration
from touchline.model.robot import Robot, load_robot
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples
from touchline.trials.free_motion import (
    MotionMaker,
    generator,
    imperfect,
    random_trajectory,
    with_noise,
)
from touchline.workers import workers

METHODS = cal.METHODS
ERROR = 0.02  # 1 sigma of the inertias
ARM_SEED = 1  # one arm has one set of errors
SECONDS = 60.0  # length of a recording
LAYOUTS = {"sara": "extended", "joints": "joint torques", "classical": "classical"}
CALIBRATED, TESTED, PUSHED = 1, 2, 3  # seeds of trajectories that never meet


@dataclass(frozen=True)
class Setting:
    """What is simulated.

    Attributes:
        layout: "sara": joints 2 to 5 and three six-axis sensors; "joints": seven joint torques
            and no other sensor; "classical": both, seven and three, for the classical observer.
        rate: samples per second [Hz].
        velocity: noise of the velocities [rad/s], 1 sigma per sample.
    """

    layout: str
    rate: float
    velocity: float


@lru_cache(maxsize=4)
def description(layout: str, velocity: float) -> Robot:
    """The robot as described; tests fire at once."""
    robot = load_robot("sara" if layout == "sara" else "sara-full")
    if layout == "joints":
        noise = replace(robot.description.noise, sensors={})
        bare = replace(robot.description, sensors=(), noise=noise, bandwidth_sensors={})
        robot = Robot(bare, robot.mechanism)
    return cal.with_methods(with_noise(robot, velocity), "rows", min_duration=0.0)


@lru_cache(maxsize=8)
def maker(setting: Setting, seconds: float = SECONDS) -> MotionMaker:
    """Makes the recordings of a setting."""
    robot = description(setting.layout, setting.velocity)
    return MotionMaker(robot, imperfect(robot, ERROR, ARM_SEED), setting.rate, seconds)


def recordings(setting: Setting, seed: int, numbers: Iterable[int]) -> Iterator[list[Samples]]:
    """Contact-free recordings."""
    make = maker(setting)
    for number in numbers:
        rng = generator(seed, number)
        yield [make.samples(random_trajectory(make.robot, rng), rng)]


def row_figures(setting: Setting, count: int) -> dict[str, RowCalibration]:
    """What the model's errors leave in the rows of `count` recordings."""
    robot, period = description(setting.layout, setting.velocity), 1.0 / setting.rate
    found = cal.collect_residuals(robot, period, recordings(setting, CALIBRATED, range(count)))
    return cal.fit_rows(robot, period, found)


def statistics(
    setting: Setting, rows: dict[str, RowCalibration], seed: int, numbers: range
) -> cal.Statistics:
    """The statistics of all methods in some recordings."""
    robot, period = description(setting.layout, setting.velocity), 1.0 / setting.rate
    return cal.collect_statistics(robot, period, rows, recordings(setting, seed, numbers))


def joined(parts: list[cal.Statistics]) -> cal.Statistics:
    """Parts from several processes as one."""
    return cal.Statistics(
        np.concatenate([p.blocks for p in parts]),
        np.concatenate([p.time for p in parts]),
        np.concatenate([p.recording + 100_000 * i for i, p in enumerate(parts)]),
        sum(p.hours for p in parts),
        parts[0].length,
    )


def push_statistics(
    setting: Setting, rows: dict[str, RowCalibration], force: float, numbers: range
) -> Array:
    """Statistics (trials, samples, methods) on the structure, from the onset of pushes on."""
    robot, period = description(setting.layout, setting.velocity), 1.0 / setting.rate
    make = PushMaker(maker(setting, BEFORE + AFTER))
    robot = cal.with_methods(robot, *METHODS)
    calibration = cal.describe(1.0, period, rows, {})
    robot = cal.with_calibration(robot, calibration)
    thresholds = cal.watching(robot, period, rows)
    found = []
    skin_robot = description("sara", setting.velocity)  # the same places in every layout
    for number, push in enumerate(random_pushes(skin_robot, numbers.stop, PUSHED)):
        if number < numbers.start:
            continue
        s = make.samples(push, force, generator(PUSHED, number, round(1000 * force)))
        detector = Detector(Observer(robot), thresholds, period)
        d = detector.details(s.time, s.q, s.qd, s.tau, s.wrench, len(s.time))
        found.append(d.statistics[make.first - 1 :, 0])
    return np.array(found)


class Pool:
    """Runs pieces of work on all cores, with a progress bar for each kind of work."""

    def __init__(self, count: int | None = None) -> None:
        self._workers = workers(count)

    def __enter__(self) -> "Pool":
        self._pool = self._workers.__enter__()
        return self

    def __exit__(self, *error: Any) -> None:
        self._workers.__exit__(*error)

    def map(self, what: str, work, pieces: list[tuple]) -> list:
        """`work(*piece)` for every piece, in their order."""
        from tqdm import tqdm

        jobs = [self._pool.submit(work, *piece) for piece in pieces]
        bar = tqdm(jobs, desc=what, disable=None, leave=False)
        return [job.result() for job in bar]


def pieces(count: int, size: int) -> list[range]:
    """Numbers 0 to `count`, in pieces."""
    return [range(start, min(start + size, count)) for start in range(0, count, size)]
