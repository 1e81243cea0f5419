# SPDX-License-Identifier: Apache-2.0
"""Arms that move and are not as told, pushed every three seconds; calibrated before, or not."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from itertools import groupby
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from touchline.bench.imperfect.faults import FAULTS, SEVERAL, Fault
from touchline.bench.pushes.judge import Push, Tally, judge
from touchline.bench.tables import Row, aligned
from touchline.calibrate.plan import Plan, make_plan
from touchline.calibrate.run import calibrate
from touchline.errors import InputError
from touchline.logs import write_table
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scene import Run
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import COARSE, MotionMaker, planned
from touchline.trials.recordings import EVERY, push_often
from touchline.workers import workers

PHYSICS = 2000.0  # Hz
HEAD = (
    *("arm", "what is wrong", "pushes", "found", "extra", "placed", "no body", "right body"),
    *("sure wrong", "far", "held", "cleared", "idle"),
)


@dataclass(frozen=True)
class Part:
    """A recording.

    Attributes:
        arm: its name.
        wrong: what is wrong with the arm.
        seed: of all that is random.
        seconds: its length [s].
        rate: of the recording that the arm is calibrated on before [Hz]; None: it is not.
    """

    arm: str
    wrong: str
    seed: int
    seconds: float
    rate: float | None = None

    @property
    def fault(self) -> Fault:
        """What is wrong."""
        return next(fault for fault in (*FAULTS, SEVERAL) if fault.name == self.wrong)


def play(part: Part) -> tuple[Robot, Samples, list[Push]]:
    """Simulates a recording: the robot as told, what its sensors report, and the pushes."""
    robot, fault = described_arm(part.arm), part.fault
    arm = fault.arm(robot.mechanism, np.random.default_rng([part.seed, 2]))
    settings = Run(part.seed, physics=PHYSICS, noise=SensorNoise(), arm=arm)
    simulated, contacts = push_often(robot, settings, part.seconds)
    samples = fault.read(robot, simulated.samples, np.random.default_rng([part.seed, 13]))
    bodies = {link: body.name for body in robot.bodies for link in body.links}
    pushes = [
        Push(
            begin=c.profile.start,
            release=c.profile.end - c.profile.fall,
            end=c.profile.end,
            body=bodies[c.link],
            path=simulated.truth.point[:, k],
        )
        for k, c in enumerate(contacts)
    ]
    return robot, samples, pushes


def calibrated(part: Part, rate: float) -> Robot:
    """The robot as `calibrate` describes it after the motion that it proposes.

    Raises:
        InputError: it refuses.
    """
    robot, fault = described_arm(part.arm), part.fault
    arm = fault.moving(robot, np.random.default_rng([part.seed, 2]))
    plan = _plan(part.arm)
    maker = MotionMaker(robot, arm, rate, float(plan.time[-1]))
    right = maker.sensed(*maker.loads(planned(plan)), np.random.default_rng([part.seed, 14]))
    read = fault.read(robot, right, np.random.default_rng([part.seed, 13]))
    with TemporaryDirectory() as folder:
        log, out = Path(folder) / "log.parquet", Path(folder) / "robot.yaml"
        write_table(log, read, robot.description)
        calibrate([log], robot.description.path or part.arm, out)
        return load_robot(out)


@lru_cache(maxsize=1)
def _plan(arm: str) -> Plan:
    return make_plan(described_arm(arm))


def run(part: Part) -> Tally:
    """Plays a recording to an arm."""
    robot, s, pushes = play(part)
    pipeline = Pipeline(robot if part.rate is None else calibrated(part, part.rate))
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    return judge(s.time, pushes, pipeline.events)


def tallies(parts: Sequence[Part], processes: int) -> Iterator[Tally]:
    """Of all recordings, in their order, by so many processes."""
    from tqdm import tqdm

    bar = partial(tqdm, total=len(parts), desc="pushes", disable=None, leave=False)
    if processes <= 1 or len(parts) <= 1:
        yield from bar(map(run, parts))
        return
    with workers(processes) as pool:
        yield from bar(pool.map(run, parts))


def main(
    arms: Sequence[str],
    wrong: Sequence[str],
    seeds: int,
    first: int,
    seconds: float,
    processes: int,
    rate: float | None = None,
) -> None:
    """Prints a line for each arm and what is wrong with it, and one for all arms together.

    Args:
        arms: names, see `described_arm`.
        wrong: names of faults.
        seeds: recordings of each line.
        first: the first of their seeds.
        seconds: length of each.
        processes: that work at a time.
        rate: as of `Part`, a multiple of `COARSE`.

    Raises:
        InputError: it is none, or an arm cannot be loaded or calibrated.
    """
    if rate is not None and not (rate > 0.0 and rate % COARSE == 0.0):
        raise InputError(f"--calibrate {rate:g}: must be a multiple of {COARSE:g} Hz")
    numbers = range(first, first + seeds)
    parts = [Part(arm, name, k, seconds, rate) for arm in arms for name in wrong for k in numbers]
    found = zip(parts, tallies(parts, processes), strict=True)
    by_line: dict[tuple[str, str], Tally] = {}
    for key, group in groupby(found, lambda pair: (pair[0].arm, pair[0].wrong)):
        by_line[key] = sum((tally for _, tally in group), Tally())
    rows: list[Row] = [HEAD]
    rows += [(*key, *told(tally)) for key, tally in by_line.items()]
    for name in wrong:
        rows.append(("all", name, *told(sum((by_line[a, name] for a in arms), Tally()))))
    known = "not calibrated" if rate is None else f"calibrated on 60 s at {rate:g} Hz"
    print(f"Pushes every {EVERY:g} s on arms that move, are not as told and {known}:")
    print(aligned(rows, (0, 1)))


def told(tally: Tally) -> tuple[str, ...]:
    """A tally as the cells of a line."""
    counts = (
        *(tally.pushes, tally.found, tally.extra, tally.placed, tally.bodiless, tally.right),
        *(tally.sure_wrong, tally.far, tally.held, tally.cleared),
    )
    return (*map(str, counts), f"{100.0 * tally.idle / max(tally.free, 1e-9):.1f} %")
