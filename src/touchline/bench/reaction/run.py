# SPDX-License-Identifier: Apache-2.0
"""`touchline bench reaction`: what a collision does, by the robot's reaction.

The arm runs into a compliant body, or the body into the arm, at 0.25 to 1.5 m/s. In the loop are
sensors with noise, the pipeline, the reaction and a controller at 1 kHz with torque limits. The
plant's inertias are 2 % off. Every encounter is repeated with every reaction. Beside that, the arm
is led by its handle for an hour.
"""

import csv
import os
from collections.abc import Callable, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from touchline.bench.request import prepare_results
from touchline.bench.tables import Row, aligned
from touchline.numbers import check_least
from touchline.reaction.reaction import REACTIONS
from touchline.trials.guiding import PART, Guided, guide, told
from touchline.trials.reacting import MASSES, QUIET, SCENES, SPRINGS, Case, Trial, cases, play
from touchline.workers import workers

IN_TIME = 0.3  # s within which a clamping force is to be gone
SAME = 1.005  # peaks that differ by less are the same


def run_trials(todo: Sequence[Case]) -> list[Trial]:
    """Plays the cases on all cores."""
    return [trial for trials in _on_all_cores(play, todo, "reaction") for trial in trials]


def run_guiding(hours: float) -> list[Guided]:
    """An arm is led by its handle, on all cores."""
    return _on_all_cores(guide, range(round(3600 * hours / PART)), "guiding")


def _on_all_cores(function: Callable[[Any], Any], arguments: Sequence[Any], name: str) -> list[Any]:
    from tqdm import tqdm

    if not arguments:
        return []
    processes = len(os.sched_getaffinity(0))
    with workers(processes) as pool:
        results = pool.map(function, arguments)
        return list(tqdm(results, total=len(arguments), desc=name, disable=None, leave=False))


def table(trials: Sequence[Trial]) -> str:
    """Medians by scene and reaction."""
    rows: list[Row] = [
        ("", "n", "peak N", "x none", "worst x", "Ns", "< 20 N ms", "never", "way mm", "acts ms")
    ]
    without = {_key(trial): trial.peak for trial in trials if trial.reaction == "ignore"}
    for scene in SCENES:
        for reaction in REACTIONS:
            chosen = [t for t in trials if t.scene == scene and t.reaction == reaction]
            if chosen:
                rows.append(_row(f"{scene}, {reaction}", chosen, without))
    return aligned(rows)


def _key(trial: Trial) -> tuple[str, str, float, int]:
    return trial.scene, trial.link, trial.speed, trial.seed


def _row(name: str, trials: Sequence[Trial], without: dict[tuple, float]) -> Row:
    ratios = [trial.peak / without[_key(trial)] for trial in trials]
    quiet = np.array([trial.quiet for trial in trials])
    acts = [trial.reacted for trial in trials if np.isfinite(trial.reacted)]
    return (
        name,
        str(len(trials)),
        f"{np.median([trial.peak for trial in trials]):.0f}",
        f"{np.median(ratios):.2f}",
        f"{np.max(ratios):.3f}",
        f"{np.median([trial.impulse for trial in trials]):.1f}",
        f"{1e3 * np.median(quiet[np.isfinite(quiet)]):.0f}" if np.isfinite(quiet).any() else "-",
        str(int(np.isnan(quiet).sum())),
        f"{1e3 * np.median([trial.way for trial in trials]):.1f}",
        f"{1e3 * np.median(acts):.0f}" if acts else "-",
    )


def summary(trials: Sequence[Trial]) -> str:
    """What must hold, and whether it does."""
    without = {_key(trial): trial.peak for trial in trials if trial.reaction == "ignore"}
    acting = [trial for trial in trials if trial.reaction != "ignore"]
    raised = [trial for trial in acting if trial.peak > SAME * without[_key(trial)]]
    clamps = [t for t in acting if t.scene == "wall" and t.reaction == "retract"]
    gone = [trial for trial in clamps if trial.quiet <= IN_TIME]
    missed = [t for t in acting if np.isnan(t.reacted) and t.peak > QUIET]
    lines = [
        f"peak force higher than without reaction: {len(raised)} of {len(acting)}",
        f"largest joint torque: {max(t.effort for t in trials):.3f} of its limit",
        f"wall, retract: below {QUIET:g} N within {IN_TIME:g} s in {len(gone)} of {len(clamps)}",
        f"not taken for a collision: {len(missed)} of {len(acting)}; "
        f"reacted to nothing, or to the hand that leads: {sum(t.false for t in trials)}",
    ]
    named = [f"  higher: {_name(trial, without)}" for trial in raised]
    named += [f"  slower: {_name(trial, without)}" for trial in clamps if trial not in gone]
    named += [f"  missed: {_name(trial, without)}" for trial in missed]
    return "\n".join(lines + named)


def _name(trial: Trial, without: dict[tuple, float]) -> str:
    return (
        f"{trial.scene}, {trial.link} at {trial.speed:g} m/s, {trial.spring / 1e3:.0f} kN/m, "
        f"{trial.mass:.1f} kg, {trial.reaction}: {trial.peak:.1f} N, {without[_key(trial)]:.1f} N "
        f"without; below 20 N after {trial.quiet:.3f} s"
    )


def main(encounters: int = 2, hours: float = 1.0, out: Path | None = None) -> None:
    """Prints the tables of `sara`.

    Args:
        encounters: for each link and speed.
        hours: of guiding by the handle; 0 leaves it out.
        out: folder for `reaction.csv`, one row for each encounter and reaction, and figures.
    """
    check_least(1, encounters=encounters)
    check_least(0, guiding=hours)
    prepare_results(out)
    todo = list(cases(encounters))
    trials = run_trials(todo)
    print(f"reaction benchmark: sara, {len(todo)} encounters, each with every reaction; medians")
    (soft, hard), (light, heavy) = np.array(SPRINGS) / 1e3, MASSES
    bodies = f"bodies of {light:g} to {heavy:g} kg, wall: one that cannot give way"
    print(f"springs of {soft:g} to {hard:g} kN/m; free and guided: {bodies}\n")
    print(f"{table(trials)}\n\n{summary(trials)}")
    parts = run_guiding(hours)
    if parts:
        print(f"\n{told(parts)}")
    if out is not None:
        from touchline.bench.reaction.figure import save_figures

        write(out / "reaction.csv", trials)
        save_figures(out, trials)


def write(path: Path, trials: Sequence[Trial]) -> None:
    """Writes the trials as CSV."""
    rows = [asdict(trial) for trial in trials]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
