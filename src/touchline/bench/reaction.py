# SPDX-License-Identifier: Apache-2.0
"""`touchline bench reaction`: what a collision does to both sides, by the robot's reaction.

The arm runs into a compliant body, or the body into the arm, at 0.25 to 1.5 m/s; in the loop are
sensors with noise, the pipeline, the reaction and a controller at 1 kHz with torque limits; the
plant's inertias are 2 % off. Every encounter is repeated with every reaction.
"""

import csv
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from touchline.bench.tables import Row, aligned
from touchline.contact.reaction import REACTIONS
from touchline.contact.reactor import Reactor
from touchline.model.description import PolicyDescription, PolicyRule
from touchline.model.robot import Robot, load_robot
from touchline.simulation.encounter import HIT_TIME, EncounterScene, Outcome
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scene import Run

SPEEDS = (0.25, 0.5, 1.0, 1.5)  # m/s
LINKS = ("link0", "link1", "link2", "link3", "link5", "link7", "tool", "handle")
CLAMP_SPEEDS = (0.25, 0.5)
CLAMP_LINKS = ("link2", "link3", "link5", "link7", "tool", "handle")
SECONDS = 0.8
QUIET = 20.0  # N


@dataclass(frozen=True)
class Case:
    """One encounter, to be played with each reaction; `wall`: the body cannot give way."""

    link: str
    speed: float
    wall: bool
    seed: int


@dataclass(frozen=True)
class Trial:
    """One encounter with one reaction; times from the first touch, NaN where it never came.

    Attributes:
        link: that was struck.
        speed: of approach [m/s].
        wall: whether the body could give way (False) or not.
        seed: of the encounter.
        reaction: of the robot.
        peak: largest contact force [N].
        impulse: of the contact force [N s].
        quiet: time after which the force stays below 20 N [s].
        way: of the struck point towards the body from the first touch on [m].
        reacted: time of the first reacting torque [s].
        effort: largest joint torque, as a part of its limit.
        clipped: whether a limit cut the reaction.
    """

    link: str
    speed: float
    wall: bool
    seed: int
    reaction: str
    peak: float
    impulse: float
    quiet: float
    way: float
    reacted: float
    effort: float
    clipped: bool


@cache
def _scene() -> EncounterScene:
    settings = Run(noise=SensorNoise(), control=1000.0, model_error=0.02)
    return EncounterScene(load_robot("sara"), settings)


def play(case: Case) -> list[Trial]:
    """The case with every reaction."""
    scene = _scene()
    rng = np.random.default_rng([case.seed, LINKS.index(case.link), round(1000 * case.speed)])
    mass = np.inf if case.wall else 4.0
    encounter = scene.draw((case.link,), case.speed, rng, mass=mass)
    trials = []
    for name in REACTIONS:
        outcome = scene.play(encounter, reactor(scene.robot, name), SECONDS, case.seed)
        trials.append(measure(scene, outcome, case, name))
    return trials


def reactor(robot: Robot, reaction: str) -> Reactor:
    """That answers every collision with one reaction."""
    return Reactor(robot, PolicyDescription(rules=[PolicyRule(reaction, level="collision")]))


def measure(scene: EncounterScene, outcome: Outcome, case: Case, reaction: str) -> Trial:
    """The figures of one simulated encounter."""
    robot, readings = scene.robot, outcome.readings
    time = readings.time
    force = np.linalg.norm(outcome.truth.force[:, 0], axis=1)
    touched = np.flatnonzero(force > 0.0)
    begin = float(time[touched[0]]) if len(touched) else HIT_TIME
    loud = time[force > QUIET]
    acting = [step for step in outcome.steps if step.command.reaction != "ignore"]
    place = np.array([_point(robot, q, outcome) for q in readings.q[time >= begin]])
    way = (place - place[0]) @ -np.asarray(outcome.encounter.body.direction)
    efforts = np.array([robot.mechanism.joints[name].effort for name in robot.joint_names])
    return Trial(
        **asdict(case),
        reaction=reaction,
        peak=float(force.max()),
        impulse=float(force.sum() * (time[1] - time[0])),
        quiet=_quiet(loud, time, begin),
        way=float(way.max()),
        reacted=float(acting[0].time - begin) if acting else float("nan"),
        effort=float(np.max(np.abs(outcome.torque) / efforts)),
        clipped=any(step.command.clipped for step in acting),
    )


def _point(robot, q, outcome: Outcome):
    """Where the struck point of the link is at `q`."""
    encounter = outcome.encounter
    T_then = robot.T_world_links(encounter.q)[encounter.link]
    local = np.linalg.inv(T_then) @ np.append(np.asarray(encounter.body.point), 1.0)
    return (robot.T_world_links(q)[encounter.link] @ local)[:3]


def _quiet(loud, time, begin: float) -> float:
    if not len(loud):
        return 0.0
    return float("nan") if loud[-1] == time[-1] else float(loud[-1] - begin)


def cases(rounds: int) -> Iterator[Case]:
    """All cases, `rounds` encounters for each link and speed."""
    for seed in range(rounds):
        yield from (Case(link, speed, False, seed) for link in LINKS for speed in SPEEDS)
        yield from (Case(link, speed, True, seed) for link in CLAMP_LINKS for speed in CLAMP_SPEEDS)


def run_trials(todo: Sequence[Case]) -> list[Trial]:
    """Plays the cases on all cores."""
    from tqdm import tqdm

    with ProcessPoolExecutor() as pool:
        results = pool.map(play, todo, chunksize=1)
        done = tqdm(results, total=len(todo), desc="reaction", disable=None, leave=False)
        return [trial for trials in done for trial in trials]


def table(trials: Sequence[Trial]) -> str:
    """Medians by reaction, for bodies that give way and for walls."""
    head = ("", "n", "peak N", "x ignore", "worst x", "impulse Ns", "< 20 N ms", "never", "way mm")
    rows: list[Row] = [(*head, "reacts ms", "effort")]
    for wall, name in ((False, "free body"), (True, "wall")):
        for reaction in REACTIONS:
            chosen = [t for t in trials if t.wall == wall and t.reaction == reaction]
            if chosen:
                rows.append(_row(f"{name}, {reaction}", chosen, _ignored(trials)))
    return aligned(rows)


def _ignored(trials: Sequence[Trial]) -> dict[tuple, Trial]:
    return {_key(t): t for t in trials if t.reaction == "ignore"}


def _key(trial: Trial) -> tuple:
    return trial.link, trial.speed, trial.wall, trial.seed


def _row(name: str, trials: Sequence[Trial], ignored: dict[tuple, Trial]) -> Row:
    ratios = [t.peak / ignored[_key(t)].peak for t in trials]
    quiet = np.array([t.quiet for t in trials])
    reacted = [t.reacted for t in trials if np.isfinite(t.reacted)]
    return (
        name,
        str(len(trials)),
        f"{np.median([t.peak for t in trials]):.0f}",
        f"{np.median(ratios):.2f}",
        f"{np.max(ratios):.2f}",
        f"{np.median([t.impulse for t in trials]):.1f}",
        f"{1e3 * np.median(quiet[np.isfinite(quiet)]):.0f}" if np.isfinite(quiet).any() else "-",
        str(int(np.isnan(quiet).sum())),
        f"{1e3 * np.median([t.way for t in trials]):.0f}",
        f"{1e3 * np.median(reacted):.0f}" if reacted else "-",
        f"{np.max([t.effort for t in trials]):.2f}",
    )


def main(encounters: int = 2, out: Path | None = None) -> None:
    """Prints the table of `sara`.

    Args:
        encounters: for each link and speed.
        out: folder for `reaction.csv`, one row for each encounter and reaction.
    """
    todo = list(cases(encounters))
    trials = run_trials(todo)
    print(f"reaction benchmark: sara, {len(todo)} encounters, each with every reaction; medians")
    print("spring 25 kN/m; free body 4 kg; x ignore: peak against that without reaction\n")
    print(table(trials))
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write(out / "reaction.csv", trials)


def write(path: Path, trials: Sequence[Trial]) -> None:
    """Writes the trials as CSV."""
    rows = [asdict(trial) for trial in trials]
    with path.open("w", newline="") as file:
        writer = csv.DictWriter(file, list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
