# SPDX-License-Identifier: Apache-2.0
"""`touchline bench detection`: how soon pushes are found, at which rate of false alarms.

Prescribed motion up to 3 rad/s of an arm whose inertias are 2 % off, ordinary sensor noise, no
physics engine. Thresholds are calibrated on some trajectories; false alarms are counted on others,
and sudden pushes on the structure are found or not on others again.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.bench.detection import classical as detection_classical
from touchline.bench.detection import work as detection_work
from touchline.bench.detection.outcome import GOALS, Outcome
from touchline.bench.detection.tables import alarm_table, delay_table
from touchline.bench.detection.work import (
    CALIBRATED,
    LAYOUTS,
    SECONDS,
    TESTED,
    Pool,
    Setting,
    description,
    joined,
    pieces,
)
from touchline.bench.request import prepare_results
from touchline.detector.calibration import fit_tails
from touchline.errors import InputError
from touchline.numbers import check_least

FORCES = (2.0, 5.0, 10.0, 20.0, 50.0)  # N
TRIALS = 200  # pushes of each force
LEAST_HOURS = 0.1  # less has no tail
FIGURES = 30  # recordings that the row figures come from
PIECE = 10  # recordings, or pushes times five, that a process takes at a time
VELOCITIES = tuple(dict.fromkeys(velocity for _, velocity in GOALS))


@dataclass(frozen=True)
class Plan:
    """What to measure.

    Attributes:
        observers: "extended", "joints" (seven joint torques alone), "classical".
        rates: samples per second [Hz].
        velocities: noise of the velocities [rad/s].
        hours: of calibration, and as many of other trajectories for the count of false alarms.
        trials: pushes of each force.
    """

    observers: tuple[str, ...] = ("extended", "joints", "classical")
    rates: tuple[float, ...] = (1000.0, 8000.0)
    velocities: tuple[float, ...] = VELOCITIES
    hours: float = 0.5
    trials: int = TRIALS

    def settings(self) -> list[Setting]:
        """Every combination.

        Raises:
            InputError: there is none, or no goal is set for one of them.
        """
        settings = [
            Setting("sara" if observer == "extended" else observer, rate, velocity)
            for observer in self.observers
            for rate in self.rates
            for velocity in self.velocities
        ]
        if not settings:
            raise InputError("nothing to run: one of observers, rates, velocity noise is empty")
        for s in settings:
            if (s.rate, s.velocity) not in GOALS:
                allowed = ", ".join(f"{v:g}" for v in VELOCITIES)
                raise InputError(f"velocity noise {s.velocity:g} rad/s; allowed: {allowed}")
        return settings


def measure(setting: Setting, hours: float, trials: int, pool: Pool) -> Outcome:
    """Calibrates, counts false alarms for `hours`, and pushes `trials` times with each force."""
    work = detection_classical if setting.layout == "classical" else detection_work
    name = f"{LAYOUTS[setting.layout]}, {setting.rate / 1000:g} kHz, {setting.velocity:g} rad/s"
    count = max(1, round(hours * 3600 / SECONDS))
    (rows,) = pool.map(f"{name}: rows", work.row_figures, [(setting, min(FIGURES, count))])
    parts = [
        joined(
            pool.map(
                f"{name}: {what}",
                work.statistics,
                [(setting, rows, which, numbers) for numbers in pieces(count, PIECE)],
            )
        )
        for what, which in (("calibration", CALIBRATED), ("false alarms", TESTED))
    ]
    tails = fit_tails(description(setting.layout, setting.velocity), parts[0], work.METHODS)
    pushes = {}
    for force in FORCES:
        jobs = [(setting, rows, force, numbers) for numbers in pieces(trials, 5 * PIECE)]
        pushes[force] = np.concatenate(pool.map(f"{name}: {force:g} N", work.push_statistics, jobs))
    return Outcome(setting, work.METHODS, tails, parts[1], pushes, parts[0].hours)


def run(plan: Plan) -> Iterator[Outcome]:
    """The outcomes of a plan, as they are done."""
    with Pool() as pool:
        for setting in plan.settings():
            yield measure(setting, plan.hours, plan.trials, pool)


def main(plan: Plan, out: Path | None = None) -> None:
    """Prints the tables of every setting as it is done.

    Args:
        plan: what to measure.
        out: folder for roc.csv, tails.csv and figures, which keep what other runs have written.

    Raises:
        InputError: the plan is empty or has impossible numbers, or the folder cannot be made.
        ModuleNotFoundError: figures are wanted and matplotlib is missing.
    """
    check_least(LEAST_HOURS, hours=plan.hours)
    check_least(1, pushes=plan.trials)
    plan.settings()
    prepare_results(out)
    print(
        f"detection benchmark: sara, inertias 2 % off, up to 3 rad/s, {plan.trials} pushes a force"
    )
    print("false alarms per hour of the whole robot, on other trajectories than calibrated on")
    print(
        "(95 % Poisson interval); delay in which 95 % of sudden pushes on the structure are found"
    )
    print("[ms], at one false alarm per hour; -: fewer are found within 50 ms")
    done: list[Outcome] = []
    for outcome in run(plan):
        done.append(outcome)
        print(f"\n{alarm_table([outcome])}\n\n{delay_table([outcome])}", flush=True)
        if out is not None:
            from touchline.bench.detection import files as detection_files
            from touchline.bench.detection.drawing import draw

            detection_files.write(outcome, out)
            draw(detection_files.read(out / "roc.csv"), out)
    if len(done) > 1:
        print(f"\ntogether\n\n{alarm_table(done)}\n\n{delay_table(done)}")
    if out is not None:
        print(f"\n{out}: roc.csv, tails.csv, roc.svg, delay.svg")
