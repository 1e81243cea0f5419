# SPDX-License-Identifier: Apache-2.0
"""`touchline bench deadline`: how long single updates take, by number of contacts.

Every update of random touches is timed by the CPU time of its thread, from the first sample on.
The same input goes three times through a new pipeline, and of each update the least time counts.
What the machine does to one of them it rarely does to all; what the update needs comes back.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import count
from time import thread_time_ns

import numpy as np

from touchline.arrays import Array
from touchline.bench.tables import Row, aligned
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.numbers import check_least
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.arms import TIERS
from touchline.trials.cell import Begin, Cell
from touchline.trials.interactions import ARM_SPEED, InteractionSampler
from touchline.trials.scene import arm_and_skin, make_pipeline, make_scene
from touchline.trials.touches import Signals, TouchSampler, resting_signals

BUDGET = 125.0  # us: the observer runs at 8 kHz on the robot (Iskandar et al., ICRA 2021)
REPEATS = 3
TIER = 1  # of noise
IDLE = 1.0  # s of a run without contact
WEAK = (2.0, 5.0)  # N: what many places of several links explain, and
SPEED = 0.5  # rad/s of every joint meanwhile
KINDS = ("contact", "collision")  # of two hands that clamp a link, in turn
LINES = 10 + len(WEAK)  # of an arm
ALONE = {"panda": "panda-torques"}  # the same arm without a six-axis sensor
ALONE_LINES = 3  # of that one
HEAD: Row = (
    "arm", "contacts", "begin", "force", "motion",
    "updates", "median", "p99", "p99.9", "p99.99", "max", f"over {BUDGET:g} us", "first update",
)  # fmt: skip


@dataclass(frozen=True)
class Line:
    """Times [us] of all updates of one line, and of the first ones of its runs."""

    arm: str
    contacts: int
    begin: str
    force: str
    motion: str
    times: Array
    first: Array

    @property
    def over(self) -> float:
        """Share of the updates that take longer than `BUDGET`."""
        return float((self.times > BUDGET).mean())

    def row(self) -> Row:
        """Of the table."""
        marks = np.percentile(self.times, [50, 99, 99.9, 99.99])
        return (
            self.arm, str(self.contacts), self.begin, self.force, self.motion,
            str(len(self.times)),
            *(f"{mark:.1f}" for mark in marks), f"{self.times.max():.1f}",
            f"{100 * self.over:.3f} %", f"{self.first.max():.1f}",
        )  # fmt: skip


def update_times(make: Callable[[], Pipeline], signals: Signals, repeats: int = REPEATS) -> Array:
    """Least CPU time [us] of each update (N,), over repeats of the same signals.

    Args:
        make: makes a new pipeline.
        signals: N samples.
        repeats: how often they go through a new pipeline.
    """
    s = signals
    samples = list(zip(s.time.tolist(), s.q, s.qd, s.tau, s.wrench, strict=True))
    least = np.full(len(samples), np.inf)
    for _ in range(repeats):
        update = make().update
        for i, sample in enumerate(samples):
            begin = thread_time_ns()
            update(*sample)
            spent = (thread_time_ns() - begin) * 1e-3
            least[i] = min(least[i], spent)
    return least


def clock_cost() -> float:
    """Median [us] of what lies between two readings of the thread's clock: no part of an update."""
    taken = [0] * 1001
    for i in range(len(taken)):
        begin = thread_time_ns()
        taken[i] = thread_time_ns() - begin
    return float(np.median(taken)) * 1e-3


def lines(
    arms: tuple[str, ...], updates: int, seed: int = 0, period: float = 1e-3
) -> Iterator[Line]:
    """Every arm with 0 to 4 contacts, apart or at the same instant; weak ones and clamps in motion.

    Two hands that tremble, too; and after the Panda the same arm with its joint torques alone.

    Args:
        arms: names of arms of the localization benchmark.
        updates: of each line, at least.
        seed: of all that is random.
        period: between samples [s].
    """
    kinds: list[tuple[int, Begin]] = [
        (0, "apart"),
        (1, "apart"),
        (2, "apart"),
        (2, "together"),
        (3, "apart"),
        (3, "together"),
        (4, "apart"),
        (4, "together"),
    ]
    for arm in arms:
        for contacts, begin in kinds:
            yield _line(Cell(arm, contacts, TIER, begin=begin, period=period), updates, seed)
        for force in WEAK:
            weak = Cell(arm, 1, TIER, speed=SPEED, force=force, period=period)
            yield _line(weak, updates, seed)
        yield _clamped(arm, updates, seed, period)
        yield _line(Cell(arm, 2, TIER, hands="trembling", period=period), updates, seed)
        if arm in ALONE:
            for contacts in (1, 2):
                yield _line(Cell(ALONE[arm], contacts, TIER, period=period), updates, seed)
            yield _clamped(ALONE[arm], updates, seed, period)


def _line(cell: Cell, updates: int, seed: int) -> Line:
    robot, skin = arm_and_skin(cell.arm, cell.tier)
    times = _times(
        lambda: make_pipeline(robot, skin, period=cell.period),
        (_signals(cell, robot, run, seed) for run in count()),
        updates,
    )
    begin = cell.timing if cell.contacts > 1 else ""
    first = np.array([part[0] for part in times])
    force = f"{cell.force:g} N" if cell.contacts else ""
    return Line(cell.arm, cell.contacts, begin, force, cell.motion, np.concatenate(times), first)


def _clamped(arm: str, updates: int, seed: int, period: float) -> Line:
    """Two forces of the same strength on two sides, on an arm whose inertias are not as told."""
    robot, skin = arm_and_skin(arm, TIER)
    times = _times(
        lambda: Pipeline(robot, skin=skin, period=period),
        (_clamp(robot, skin, run, seed, period) for run in count()),
        updates,
    )
    first = np.array([part[0] for part in times])
    motion = f"<= {ARM_SPEED:g} rad/s"
    return Line(arm, 2, "clamped", "varies", motion, np.concatenate(times), first)


def _times(make: Callable[[], Pipeline], runs: Iterator[Signals], updates: int) -> list[Array]:
    times: list[Array] = []
    for signals in runs:
        times.append(update_times(make, signals))
        if sum(len(part) for part in times) >= updates:
            break
    return times


def _clamp(robot: Robot, skin: Skin, run: int, seed: int, period: float) -> Signals:
    chance = np.random.default_rng([seed, run, 3])
    sampler = InteractionSampler(robot, TouchSampler(skin, chance), chance, period)
    return sampler.draw(KINDS[run % len(KINDS)], "structure", True).signals


def _signals(cell: Cell, robot: Robot, run: int, seed: int) -> Signals:
    if cell.contacts:
        return make_scene(cell, run, seed).signals
    chance = np.random.default_rng([seed, run])
    q = chance.uniform(*robot.ranges)
    return resting_signals(robot, q, [], IDLE, chance, cell.period)


def main(updates: int, arms: tuple[str, ...], seed: int = 0, rate: int = 1000) -> None:
    """Runs the benchmark and prints its table; `rate` of samples [Hz]."""
    check_least(1, updates=updates, rate=rate)
    check_least(0, seed=seed)
    from tqdm import tqdm

    rows: list[Row] = [HEAD]
    total = sum(LINES + (ALONE_LINES if arm in ALONE else 0) for arm in arms)
    done = tqdm(lines(arms, updates, seed, 1.0 / rate), total=total, desc="deadline", disable=None)
    rows += [line.row() for line in done]
    print(aligned(rows, text_columns=(0, 2, 4)))
    print(
        f"CPU time of the thread in Pipeline.update [us], of each update the least of {REPEATS} "
        f"repeats of the same input;\nnoise {TIERS[TIER]}, {rate} Hz; "
        f"first update: the slowest one.\nIn each time {clock_cost():.1f} us are the clock's own."
    )
