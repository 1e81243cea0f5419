# SPDX-License-Identifier: Apache-2.0
"""`touchline bench localization`: how well contacts are located, by the protocol of Han and Kim.

Poses are random. Points are reachable, uniform over the area of the links: outside all other links,
3 cm free along the outward normal and along the way of the push, above the floor. Pushes are of
20 N in the friction cone, sensors at 1 kHz with white noise. The real pipeline feels them.
"""

import os
from collections.abc import Iterator
from concurrent.futures import as_completed
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter

import numpy as np

from touchline.bench.localization.baselines import BASELINES
from touchline.bench.localization.course import course_table, hands_table
from touchline.bench.localization.rank_table import rank_table
from touchline.bench.localization.segment_table import segment_tables
from touchline.bench.localization.table import (
    baseline_table,
    failures,
    published,
    tables,
)
from touchline.bench.localization.trial import Trial, run_trial
from touchline.bench.localization.trials_file import write_trials
from touchline.bench.request import prepare_results
from touchline.errors import InputError
from touchline.numbers import check_least
from touchline.trials.arms import ARMS
from touchline.trials.cell import Begin, Cell, Hands
from touchline.trials.scene import (
    arm_and_skin,
    make_pipeline,
    make_scene,
    told_and_real,
    touched_segments,
)
from touchline.workers import workers

CHUNK = 25  # runs handed to a process at once
TIMED = 6  # runs whose updates are timed


@dataclass(frozen=True)
class Plan:
    """What to run.

    Attributes:
        robots: names of arms.
        contacts: numbers of contacts.
        noise: numbers of tiers, 0 for none.
        begin: of several, as of a `Cell`. With "segments", each touch also comes alone.
        speeds: of the joints [rad/s].
        runs: per cell.
        seed: of all that is random.
        baselines: names of those that run along.
        model_error: 1 sigma of the relative errors of masses and inertias; 0: the model is right.
        calibrated: is the pipeline calibrated on motion of the same arms, if they are not as
            modelled?
        hands: what they do, as of a `Cell`.
        lasts: how long touches last after the last onset [s].
    """

    robots: tuple[str, ...] = ARMS
    contacts: tuple[int, ...] = (1, 2, 3)
    noise: tuple[int, ...] = (0, 1, 2, 3)
    begin: tuple[Begin, ...] = ("apart", "together")
    speeds: tuple[float, ...] = (0.0,)
    runs: int = 1000
    seed: int = 0
    baselines: tuple[str, ...] = tuple(BASELINES)
    model_error: tuple[float, ...] = (0.0,)
    calibrated: bool = True
    hands: tuple[Hands, ...] = ("steady",)
    lasts: float = 0.1

    def cells(self) -> list[Cell]:
        """Every combination that there is.

        Raises:
            InputError: an arm without a six-axis sensor has no segment to be touched; hands that
                are not steady touch arms at rest.
        """
        if any(hands != "steady" for hands in self.hands):
            if any(self.speeds) or any(self.model_error) or "segments" in self.begin:
                raise InputError(
                    f"--hands {' '.join(self.hands)}: hands that tremble or slide touch arms at "
                    "rest that are as told; leave out --speeds, --model-error and --begin segments"
                )
        return [
            cell
            for arm in self.robots
            for tier in self.noise
            for speed in self.speeds
            for error in self.model_error
            for hands in self.hands
            for cell in self._of(arm, tier, speed, error, hands)
        ]

    def _of(self, arm: str, tier: int, speed: float, error: float, hands: Hands) -> list[Cell]:
        base = Cell(arm, 1, tier, "apart", speed, "", error, self.calibrated, hands, self.lasts)
        cells: list[Cell] = []
        timings: list[Begin] = [begin for begin in self.begin if begin != "segments"]
        if 1 in self.contacts and timings:
            cells.append(base)
        for begin in timings:
            cells += [replace(base, contacts=n, begin=begin) for n in self.contacts if n > 1]
        if "segments" in self.begin:
            segments = touched_segments(arm_and_skin(arm, tier)[0])
            if not segments:
                raise InputError(f"--begin segments: {arm} has no six-axis sensor, so no segment")
            each = replace(base, contacts=len(segments), begin="segments")
            cells += [*each.each_alone(segments), each]
        return cells


def run_plan(plan: Plan, processes: int | None = None) -> Iterator[list[Trial]]:
    """The trials of a plan, chunk by chunk as they are done, on all cores.

    Args:
        plan: what to run.
        processes: default: one for each core; 0: in this process.
    """
    chunks = [
        (cell, range(start, min(start + CHUNK, plan.runs)), plan.seed, plan.baselines)
        for cell in plan.cells()
        for start in range(0, plan.runs, CHUNK)
    ]
    if processes == 0:
        yield from (_run_chunk(*chunk) for chunk in chunks)
        return
    count = processes or len(os.sched_getaffinity(0))
    with workers(count) as pool:
        waiting = [pool.submit(_run_chunk, *chunk) for chunk in chunks]
        for done in as_completed(waiting):
            yield done.result()


def _run_chunk(cell: Cell, runs: range, seed: int, baselines: tuple[str, ...]) -> list[Trial]:
    return [run_trial(cell, run, seed, baselines) for run in runs]


def update_time(cell: Cell, seed: int = 0, runs: int = TIMED) -> float:
    """Median time [s] of `Pipeline.update` while all contacts of a cell last.

    With position, force, level and clamping of each contact read.
    """
    spent = []
    for run in range(runs):
        scene = make_scene(cell, run, seed)
        s = scene.signals
        robot, _, skin = told_and_real(cell, run)
        pipeline = make_pipeline(robot, skin, model_error=cell.model_error)
        begun = max(onset for _, onset in scene.touches) + 0.02
        for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            start = perf_counter()
            for contact in pipeline.update(*sample).contacts:
                _ = contact.position, contact.force, contact.level, contact.clamped
            if sample[0] > begun:
                spent.append(perf_counter() - start)
    return float(np.median(spent))


def main(plan: Plan | None = None, out: Path | None = None, processes: int | None = None) -> None:
    """Runs a plan, prints its tables, and writes them with every trial into a folder."""
    from tqdm import tqdm

    plan = plan or Plan()
    check_least(1, runs=plan.runs)
    check_least(0.01, lasts=plan.lasts)
    check_least(0, seed=plan.seed, speeds=min(plan.speeds, default=0.0))
    check_least(0, **{"model-error": min(plan.model_error, default=0.0)})
    cells = plan.cells()
    if not cells:
        raise InputError(
            "nothing to run: one of robots, contacts, noise, begin, speeds, model-error is empty"
        )
    prepare_results(out)
    for arm in plan.robots:
        arm_and_skin(arm, plan.noise[0])  # a missing model is told before the work
    trials: list[Trial] = []
    with tqdm(total=plan.runs * len(cells), desc="localization", disable=None, leave=False) as bar:
        for chunk in run_plan(plan, processes):
            trials += chunk
            bar.update(len(chunk))
    order = {cell: i for i, cell in enumerate(cells)}
    trials.sort(key=lambda trial: (order[trial.cell], trial.run))
    times = {cell: update_time(cell, plan.seed, min(TIMED, plan.runs)) for cell in cells}
    parts = [tables(trials, times), segment_tables(trials, times), published()]
    parts += [
        course_table(trials),
        hands_table(trials),
        rank_table(trials),
        baseline_table(trials),
        failures(trials),
    ]
    text = "\n\n".join(part for part in parts if part)
    print(text)
    if out is not None:
        (out / "tables.txt").write_text(text + "\n", encoding="utf-8")
        write_trials(out / "trials.csv", trials)
        from touchline.bench.localization.figures import save_figures

        save_figures(out, trials)
        print(f"\nTables, every touch, and figures are in {out}")
