# SPDX-License-Identifier: Apache-2.0
"""`touchline bench classification`: contact or collision, which zone, clamped or free.

Thousands of simulated interactions (see `interactions`) through the whole pipeline, counted in
confusion matrices, with the time from the first touch to the decision.
"""

import csv
import os
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from functools import cache
from pathlib import Path

import numpy as np

from touchline.bench.request import prepare_results
from touchline.bench.tables import Row, aligned
from touchline.localizer.skin import Skin
from touchline.model.description import ZONES
from touchline.model.robot import Robot, load_robot
from touchline.numbers import check_least
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.trials.interactions import BEGIN, Interaction, InteractionSampler
from touchline.trials.touches import TouchSampler
from touchline.workers import workers

KINDS = ("contact", "collision")
CHUNK = 20
FREE, APART, SAME = "free", "clamped, two segments", "clamped, one segment"


@dataclass(frozen=True)
class Verdict:
    """One interaction and what was made of it; "" where nothing was noticed.

    Attributes:
        kind: what it was, `zone`, and `clamped` ("free" or how).
        force: largest [N].
        said_kind: "contact", "collision", or "undecided".
        said_zone: zone or "open".
        said_clamped: "free", "clamped" or "unknown".
        delay: from the first touch to the decision [s]; NaN without one.
    """

    kind: str
    zone: str
    clamped: str
    force: float
    said_kind: str
    said_zone: str
    said_clamped: str
    delay: float


@cache
def _arm() -> tuple[Robot, Skin]:
    robot = load_robot("sara")
    return robot, Skin(robot)


def judge(number: int, seed: int = 0) -> Verdict:
    """The verdict on one interaction; kinds and zones take turns, every third is a clamp."""
    robot, skin = _arm()
    rng = np.random.default_rng([seed, 8, number])
    sampler = InteractionSampler(robot, TouchSampler(skin, rng), rng)
    kind, zone = KINDS[number % 2], ZONES[number // 2 % 3]
    interaction = sampler.draw(kind, zone, number // 6 % 3 == 0)
    pipeline = Pipeline(robot, skin=skin)
    s = interaction.signals
    pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    segment = interaction.touches[0].patch.segment
    late = [event for event in pipeline.events if event.cleared is None or event.cleared > BEGIN]
    own = next((event for event in late if event.segment == segment), None)
    return _verdict(interaction, own, late)


def _verdict(interaction: Interaction, own: Event | None, events: Sequence[Event]) -> Verdict:
    segments = {touch.patch.segment for touch in interaction.touches}
    how = FREE if not interaction.clamped else APART if len(segments) > 1 else SAME
    force = float(interaction.force.max())
    if own is None:
        return Verdict(interaction.kind, interaction.zone, how, force, "", "", "", float("nan"))
    clamped = [event.clamped for event in events]
    said = "clamped" if True in clamped else "unknown" if None in clamped else "free"
    return Verdict(
        interaction.kind,
        interaction.zone,
        how,
        force,
        own.level if own.decided is not None else "undecided",
        own.zone or "open",
        said,
        float("nan") if own.decided is None else own.decided - BEGIN,
    )


def judge_all(count: int, seed: int = 0) -> Iterator[list[Verdict]]:
    """The verdicts on many interactions, part by part, on all cores."""
    parts = [(range(i, min(i + CHUNK, count)), seed) for i in range(0, count, CHUNK)]
    processes = len(os.sched_getaffinity(0))
    with workers(processes) as pool:
        yield from pool.map(_judge_part, *zip(*parts, strict=True))


def _judge_part(numbers: range, seed: int) -> list[Verdict]:
    return [judge(number, seed) for number in numbers]


def confusion(verdicts: Sequence[Verdict], truth: str, said: str, columns: Sequence[str]) -> str:
    """How often (per cent of the row) what was called what; rows as they come up."""
    names = [getattr(verdict, truth) for verdict in verdicts]
    rows: list[Row] = [("", "n", *(column or "not noticed" for column in columns))]
    for name in sorted(set(names)):
        answers = [getattr(v, said) for v in verdicts if getattr(v, truth) == name]
        shares = [f"{100 * answers.count(column) / len(answers):.1f} %" for column in columns]
        rows.append((name, str(len(answers)), *shares))
    return aligned(rows)


def delays(verdicts: Sequence[Verdict]) -> str:
    """Times from the first touch to the decision, where that was right."""
    rows: list[Row] = [("ms to the right decision", "median", "95 %", "99 %", "most")]
    for kind in KINDS:
        right = [v.delay for v in verdicts if v.kind == kind == v.said_kind]
        if right:
            figures = [*np.percentile(right, [50, 95, 99]), max(right)]
            rows.append((kind, *(f"{1e3 * figure:.0f}" for figure in figures)))
    return aligned(rows)


def tables(verdicts: Sequence[Verdict]) -> str:
    """All tables."""
    free = [v for v in verdicts if v.clamped == FREE]
    return "\n\n".join(
        [
            confusion(verdicts, "kind", "said_kind", (*KINDS, "undecided", "")),
            confusion(free, "zone", "said_zone", (*ZONES, "open", "")),
            confusion(verdicts, "clamped", "said_clamped", ("free", "clamped", "unknown", "")),
            delays(verdicts),
        ]
    )


def main(count: int = 2000, seed: int = 0, out: Path | None = None) -> None:
    """Prints the tables of `sara`.

    Args:
        count: of interactions.
        seed: of all that is random.
        out: folder for `classification.csv`, one row for each interaction.
    """
    from tqdm import tqdm

    check_least(1, interactions=count)
    check_least(0, seed=seed)
    prepare_results(out)
    verdicts: list[Verdict] = []
    with tqdm(total=count, desc="classification", disable=None, leave=False) as bar:
        for part in judge_all(count, seed):
            verdicts += part
            bar.update(len(part))
    print(f"classification benchmark: sara, {count} interactions; rows: what it was\n")
    print(tables(verdicts))
    if out is not None:
        with (out / "classification.csv").open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(file, list(asdict(verdicts[0])))
            writer.writeheader()
            writer.writerows(asdict(verdict) for verdict in verdicts)
