# SPDX-License-Identifier: Apache-2.0
"""The tables of the localization benchmark, the published figures beside them."""

from collections.abc import Iterable, Sequence

import numpy as np

from touchline.bench.localization.baselines import BASELINES
from touchline.bench.localization.columns import (
    TOUCHES,
    millimetres,
    percent,
    rate_columns,
    rms,
    touch_columns,
)
from touchline.bench.localization.touched import GROSS, NEAR, Touched
from touchline.bench.localization.trial import Trial
from touchline.bench.tables import Row, aligned
from touchline.trials.arms import TIERS
from touchline.trials.cell import Cell

HEAD: Row = (
    "contacts", "begin", "arm", "runs", "found", "95 % interval", "as event", "in the set",
    "surely wrong", *TOUCHES,
)  # fmt: skip
# Contacts, found, RMS [mm], RMS of the force [N], time [ms], source.
PUBLISHED = (
    ("1", "99.96 %", "1.6", "0.01", "0.45", "Han and Kim, ICRA 2023, Panda, noise-free"),
    ("2", "96.70 %", "10.8", "2.00", "1.66", "same"),
    ("3", "81.63 %", "35.0", "4.63", "4.50", "same"),
    ("1", "", "about 30", "", "161", "contact particle filter, Manuelli and Tedrake, IROS 2016"),
    ("2", "", "", "", "244", "same"),
    ("3", "", "", "", "395", "same"),
    ("1", "", "4.4", "", "15.97", "Han and Kim, ICRA 2025, real robot"),
    ("2", "", "12.4", "", "", "same"),
)
LEGEND = (
    "Found: every touch within 22.5 mm at the last sample, nothing else named. As event: the same\n"
    "of the events' positions. In the set: every touch near a returned explanation or in\n"
    "the part of a link that one stands for.\n"
    "Surely wrong: as many places as touches, all `located`, but not found. Body: the right\n"
    "rigid body named. Lengths in mm, force RMS in N. RMS over all that was located, RMS found\n"
    "without what is farther off than 22.5 mm. Lag: the distance in parts of |v|/K, the way a\n"
    "point at the speed |v| across its force is behind without compensation. Median and 99th\n"
    "percentile of those faster than 0.2 m/s. 90 % holds: share of truths in the 90 % region.\n"
    "Unsure: not answered by `located`. us: median time of Pipeline.update while touched,\n"
    "with position, force, level and clamping of each contact read."
)


def tables(trials: Sequence[Trial], times: dict[Cell, float]) -> str:
    """All cells but those with one contact on each segment, arm by arm and tier by tier."""
    cells = [c for c in dict.fromkeys(t.cell for t in trials) if c.begin != "segments"]
    if not cells:
        return ""
    parts = []
    for arm in dict.fromkeys(cell.arm for cell in cells):
        for tier in sorted({cell.tier for cell in cells if cell.arm == arm}):
            rows: list[Row] = [HEAD]
            own = [cell for cell in cells if (cell.arm, cell.tier) == (arm, tier)]
            for cell in own:
                of_cell = [trial for trial in trials if trial.cell == cell]
                rows.append(_line(cell, of_cell, times.get(cell, np.nan)))
            parts.append(f"{arm}, {TIERS[tier]}\n{aligned(rows, text_columns=(1, 2))}")
    return "\n\n".join([*parts, LEGEND])


def published() -> str:
    """What is published of the same, with its source."""
    head = ("contacts", "found", "RMS mm", "force RMS N", "ms", "published")
    return aligned([head, *PUBLISHED], text_columns=(5,))


def baseline_table(trials: Iterable[Trial]) -> str:
    """Every baseline beside our estimator on the same runs; empty without baselines."""
    rows: list[Row] = [("arm", "noise", "contacts", "begin", "method", "runs", "found", "> 10 cm",
                        "median", "RMS found")]  # fmt: skip
    groups: dict[tuple[Cell, str], list[Trial]] = {}
    for trial in trials:
        for name, _ in trial.baselines:
            groups.setdefault((trial.cell, name), []).append(trial)
    for (cell, name), own in groups.items():
        errors = np.array([dict(trial.baselines)[name] for trial in own])
        ours = np.array([[touch.error for touch in trial.touches] for trial in own])
        for method, error in ((BASELINES[name], errors), ("  ours, on these runs", ours)):
            near = error < NEAR
            rows.append((
                cell.arm, str(TIERS[cell.tier]), str(cell.contacts), cell.timing, method,
                str(len(own)), percent(np.mean(near.all(axis=1))),
                percent(np.mean(error > GROSS)),
                millimetres(np.nanmedian(error)) if np.isfinite(error).any() else "-",
                millimetres(rms(error[near])),
            ))  # fmt: skip
    if len(rows) == 1:
        return ""
    legend = "here found does not mind what is named besides; lengths in mm"
    return f"{aligned(rows, text_columns=(0, 1, 3, 4))}\n{legend}"


def failures(trials: Iterable[Trial]) -> str:
    """Every touch of noise-free runs that was not found, with what was named for it."""
    rows: list[Row] = [("arm", "contacts", "begin", "run", "touched", "named", "error mm", "status",
             "same body", "nearest other mm")]  # fmt: skip
    for trial in trials:
        if trial.cell.tier or trial.found:
            continue
        for touch in trial.touches:
            if not touch.error < NEAR:
                rows.append(_failure(trial, touch))
    if len(rows) == 1:
        return "Noise-free, every touch was found."
    legend = "nearest other: distance of the nearest explanation on the touched body from the truth"
    return f"{aligned(rows, text_columns=(0, 2, 4, 5, 7, 8))}\n{legend}"


def _failure(trial: Trial, touch: Touched) -> Row:
    same = "" if not touch.found_body else "yes" if touch.found_body == touch.body else "no"
    return (
        trial.cell.arm,
        str(trial.cell.contacts),
        trial.cell.timing,
        str(trial.run),
        touch.link,
        touch.found_link or "-",
        millimetres(touch.error),
        touch.status,
        same,
        millimetres(touch.candidate_error),
    )


def _line(cell: Cell, trials: list[Trial], time: float) -> Row:
    return (
        str(cell.contacts),
        cell.timing,
        cell.motion,
        str(len(trials)),
        *rate_columns(sum(trial.found for trial in trials), len(trials)),
        percent(np.mean([trial.event_found for trial in trials])),
        percent(np.mean([trial.in_set for trial in trials])),
        percent(np.mean([trial.confidently_wrong for trial in trials])),
        *touch_columns([touch for trial in trials for touch in trial.touches], time),
    )
