# SPDX-License-Identifier: Apache-2.0
"""One contact on each segment at once beside the same touches one at a time, touch by touch."""

from collections.abc import Iterator, Sequence

import numpy as np

from touchline.bench.localization.columns import TOUCHES, percent, rate_columns, touch_columns
from touchline.bench.localization.touched import Touched
from touchline.bench.localization.trial import Trial
from touchline.bench.tables import Row, aligned
from touchline.trials.arms import TIERS
from touchline.trials.cell import Cell

HEAD: Row = (
    "arm", "segment", "touched", "touches", "found", "95 % interval", "in the set",
    "surely wrong", *TOUCHES,
)  # fmt: skip
EVERY = "every"
LEGEND = (
    "touched: the segment alone, or all at once at the same places; judged touch by touch, found:\n"
    "within 22.5 mm, and nothing else named on that segment; surely wrong: called `located`, but\n"
    "not found; 90 % holds: of the region that follows from candidates and covariance"
)


def segment_tables(trials: Sequence[Trial], times: dict[Cell, float]) -> str:
    """A table for each arm and tier; empty without such trials."""
    own = [trial for trial in trials if trial.cell.begin == "segments"]
    if not own:
        return ""
    parts = []
    for arm, tier in dict.fromkeys((trial.cell.arm, trial.cell.tier) for trial in own):
        of_tier = [t for t in own if (t.cell.arm, t.cell.tier) == (arm, tier)]
        rows = [HEAD, *_rows(of_tier, times)]
        title = f"{arm}, one contact on each segment, {TIERS[tier]}"
        parts.append(f"{title}\n{aligned(rows, text_columns=(0, 1, 2))}")
    return "\n\n".join([*parts, LEGEND])


def _rows(trials: Sequence[Trial], times: dict[Cell, float]) -> Iterator[Row]:
    """Motion by motion and segment by segment: alone, then all at once; then all segments."""
    for motion in dict.fromkeys(trial.cell.motion for trial in trials):
        own = [trial for trial in trials if trial.cell.motion == motion]
        segments = list(dict.fromkeys(touch.segment for t in own for touch in t.touches))
        for segment in [*segments, EVERY] if len(segments) > 1 else segments:
            yield from _pair(own, segment, times)


def _pair(trials: Sequence[Trial], segment: str, times: dict[Cell, float]) -> Iterator[Row]:
    """The touches on a segment, or on every one, one at a time and all at once."""
    for way in ("alone", "all at once"):
        own = [t for t in trials if bool(t.cell.alone) == (way == "alone")]
        touches = [x for t in own for x in t.touches if segment in (EVERY, x.segment)]
        if touches:
            cells = {t.cell for t in own if t.cell.alone in ("", segment)}
            time = times.get(cells.pop(), np.nan) if cells else np.nan
            yield (own[0].cell.motion, segment, way, *_columns(touches, time))


def _columns(touches: Sequence[Touched], time: float) -> Row:
    return (
        str(len(touches)),
        *rate_columns(sum(touch.found for touch in touches), len(touches)),
        percent(np.mean([touch.in_set for touch in touches])),
        percent(np.mean([touch.surely_wrong for touch in touches])),
        *touch_columns(touches, time),
    )
