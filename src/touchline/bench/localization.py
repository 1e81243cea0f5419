# SPDX-License-Identifier: Apache-2.0
"""`touchline bench localization`: how well contacts are located, by force and body.

Random poses of an arm at rest, reachable points uniform over the area of its links, a force in the
friction cone for 0.3 s, the description's sensor noise; through the whole pipeline.
"""

import csv
import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from time import perf_counter

import numpy as np

from touchline.bench.touches import Touch, TouchSampler, resting_signals
from touchline.contact.pipeline import Pipeline
from touchline.contact.skin import Skin
from touchline.model.robot import Robot, load_robot

FORCES = (5.0, 10.0, 20.0, 35.0, 50.0)  # N
NEAR = 0.0225  # m, what counts as found
GROSS = 0.1  # m
BEGIN, END = 0.1, 0.4  # s, of the touch


@dataclass(frozen=True)
class Trial:
    """One touch and what was made of it; errors are NaN where nothing was located.

    `right` and `error` [m] are those of the event, `row_right` and `row_error` of the last sample.
    """

    body: str
    force: float
    status: str
    right: bool
    error: float
    force_error: float
    row_right: bool
    row_error: float
    std: float

    @property
    def found(self) -> bool:
        """Right body and near enough, over the event."""
        return self.right and self.error < NEAR

    @property
    def row_found(self) -> bool:
        """The same for the last sample alone."""
        return self.row_right and self.row_error < NEAR


def run_trials(
    robot: Robot,
    forces: Iterable[float] = FORCES,
    count: int = 400,
    seed: int = 0,
    noise: bool = True,
    segments: tuple[str, ...] | None = None,
    rule: str = "likelihood",
) -> Iterator[Trial]:
    """Touches an arm at rest, `count` times with each force [N].

    Args:
        robot: that is touched.
        forces: [N].
        count: touches per force.
        seed: of all that is random.
        noise: with the noise of the description, or none.
        segments: names of those that are touched; default: all.
        rule: of the localizer.
    """
    skin = Skin(robot)
    rng = np.random.default_rng(seed)
    sampler = TouchSampler(skin, rng, segments)
    for force in forces:
        for _ in range(count):
            touch = sampler.sample(force)
            pipeline = Pipeline(robot, skin=skin, rule=rule)
            yield _trial(pipeline, touch, force, rng if noise else None)


def _trial(
    pipeline: Pipeline, touch: Touch, force: float, rng: np.random.Generator | None
) -> Trial:
    s = resting_signals(pipeline.robot, touch.q, [(touch, BEGIN)], END, rng)
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    events = [event for event in pipeline.events if event.segment == touch.patch.segment]
    columns = pipeline.contacts.columns()
    rows = np.flatnonzero(columns["segment"] == touch.patch.segment)
    if not events or not len(rows):
        nothing = float("nan")
        return Trial(
            touch.patch.body, force, "missed", False, nothing, nothing, False, nothing, nothing
        )
    event, last = events[0], rows[-1]
    position = event.position if event.position is not None else np.full(3, np.nan)
    row = np.array([columns[axis][last] for axis in "xyz"])
    row_force = np.array([columns[axis][last] for axis in ("fx", "fy", "fz")])
    return Trial(
        body=touch.patch.body,
        force=force,
        status=event.status,
        right=event.body == touch.patch.body,
        error=float(np.linalg.norm(position - touch.position)),
        force_error=float(np.linalg.norm(row_force - touch.force)),
        row_right=columns["body"][last] == touch.patch.body,
        row_error=float(np.linalg.norm(row - touch.position)),
        std=float(columns["position_std"][last]),
    )


def update_time(robot: Robot, force: float = 20.0, seed: int = 0) -> float:
    """Median time [s] of `Pipeline.update` while one contact lasts."""
    rng = np.random.default_rng(seed)
    skin = Skin(robot)
    touch = TouchSampler(skin, rng).sample(force)
    s = resting_signals(robot, touch.q, [(touch, BEGIN)], END, rng)
    pipeline = Pipeline(robot, skin=skin)
    times = []
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        start = perf_counter()
        result = pipeline.update(*sample)
        if result.contacts:
            times.append(perf_counter() - start)
    return float(np.median(times))


def table(trials: list[Trial]) -> str:
    """The trials by force and by body."""
    head = f"{'':12}{'n':>6}{'event':>9}{'row':>9}{'body':>9}{'gross':>8}"
    head += f"{'median':>9}{'p99':>9}{'RMS':>9}{'force RMS':>11}{'unsure':>8}\n"
    head += f"{'':12}{'':>6}{'found':>9}{'found':>9}{'right':>9}{'> 10 cm':>8}"
    head += f"{'mm':>9}{'mm':>9}{'mm':>9}{'N':>11}"
    lines = [head]
    for force in sorted({trial.force for trial in trials}):
        lines.append(_line(f"{force:g} N", [t for t in trials if t.force == force]))
    lines.append("")
    for body in dict.fromkeys(sorted(trial.body for trial in trials)):
        lines.append(_line(body, [t for t in trials if t.body == body]))
    lines += ["", _line("all", trials)]
    return "\n".join(lines)


def _line(name: str, trials: list[Trial]) -> str:
    errors = np.array([t.error for t in trials if np.isfinite(t.error)])
    forces = np.array([t.force_error for t in trials if np.isfinite(t.force_error)])
    if not len(errors):
        return f"{name:12}{len(trials):6}  nothing located"
    share = [np.mean(list(x)) for x in zip(*_marks(trials), strict=True)]
    near = errors[errors < GROSS]  # a few decimetres would hide all else in the RMS
    numbers = [np.median(errors), np.percentile(errors, 99), np.sqrt(np.mean(near**2))]
    line = f"{name:12}{len(trials):6}" + "".join(f"{100 * x:8.2f}%" for x in share[:3])
    line += f"{100 * share[3]:7.2f}%" + "".join(f"{1e3 * x:9.2f}" for x in numbers)
    return line + f"{np.sqrt(np.mean(forces**2)):11.3f}{100 * share[4]:7.2f}%"


def _marks(trials: list[Trial]) -> Iterator[tuple[bool, ...]]:
    for t in trials:
        yield t.found, t.row_found, t.right, t.error > GROSS, t.status != "located"


def main(output: Path | None = None, rounds: int = 40) -> None:
    """Prints the tables of `sara`; `rounds` times ten touches with each force."""
    from tqdm import tqdm

    robot = load_robot("sara")
    count = 10 * rounds
    trials = run_trials(robot, count=count)
    total = count * len(FORCES)
    done = list(tqdm(trials, total=total, desc="localization", disable=None, leave=False))
    print(f"localization benchmark: {robot.name} at rest, default noise, {len(done)} touches")
    print("found: right body and within 22.5 mm; RMS without gross errors\n")
    print(table(done))
    print(f"\nPipeline.update with one contact: {1e6 * update_time(robot):.0f} us, median")
    print(
        "\nbest published, 20 N, noise-free, Panda with base sensor: 99.96 %, RMS 1.6 mm, 0.01 N"
        " (Han and Kim, ICRA 2023)"
    )
    if output is not None:
        write(output, done)


def write(output: Path, trials: list[Trial]) -> None:
    """Writes the trials as .json or .csv."""
    rows = [asdict(trial) for trial in trials]
    if output.suffix == ".csv":
        with output.open("w", newline="") as file:
            writer = csv.DictWriter(file, list(rows[0]))
            writer.writeheader()
            writer.writerows(rows)
    else:
        clean = [{k: None if v != v else v for k, v in row.items()} for row in rows]
        output.write_text(json.dumps(clean, indent=1))
