# SPDX-License-Identifier: Apache-2.0
"""What is said of the touches of a run in all samples, not only in the last one."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from touchline.bench.localization.columns import percent
from touchline.bench.localization.touched import NEAR, event_distances
from touchline.bench.tables import Row, aligned
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.arms import TIERS
from touchline.trials.scene import Scene

SHOWN = 0.02  # s after an onset: the filter shows most of the force
HEAD: Row = (
    "arm", "noise", "contacts", "begin", "arm is", "runs", "too many: runs", "samples",
    "surely wrong: runs", "samples",
)  # fmt: skip
LEGEND = (
    "Too many: more contacts than there are, or `not_separable`. Surely wrong: a place that is\n"
    f"`located` more than 22.5 mm from every touch. Both from {SHOWN:g} s after the last onset\n"
    "on, in any sample of a run, and in parts of all samples."
)

HANDS_HEAD: Row = (
    "arm", "noise", "contacts", "begin", "arm is", "runs", "right", "false event: runs",
    "surely wrong: runs", "samples", "events", "90 % holds",
)  # fmt: skip
HANDS_LEGEND = (
    "Right: found at the last sample, nothing else named. False event: `located`, more than\n"
    "22.5 mm from every touch. Surely wrong: the same in any sample from "
    f"{SHOWN:g} s after the last\nonset on. Events: how many in a run."
)


@dataclass(frozen=True)
class Course:
    """What was said from soon after the last onset on, and what the events say in the end.

    Attributes:
        samples: that name a contact.
        several: of them that name more contacts than there are, or one as `not_separable`.
        wrong: of them with a place that is `located` farther than `NEAR` from every touch.
        false: events that are `located` there.
    """

    samples: int
    several: int
    wrong: int
    false: int = 0


def follow_course(pipeline: Pipeline, scene: Scene) -> Course:
    """Of a run whose recording was one part."""
    signals, table = scene.signals, pipeline.contacts
    begin = max(onset for _, onset in scene.touches) + SHOWN
    late = signals.time[table.sample] >= begin
    sample, status = table.sample[late], table.columns()["status"][late]
    false = _false_places(pipeline, scene)
    if not len(sample):
        return Course(0, 0, 0, false)
    first = sample[0]
    sample = sample - first
    count = np.bincount(sample)
    several = count > len(scene.touches)
    several[sample[status == "not_separable"]] = True
    off = (
        np.linalg.norm(scene.places[:, first + sample] - table.position[late], axis=2).min(axis=0)
        > NEAR
    )
    wrong = np.unique(sample[off & (status == "located")])
    return Course(int((count > 0).sum()), int(several.sum()), len(wrong), false)


def _false_places(pipeline: Pipeline, scene: Scene) -> int:
    events = [event for event in pipeline.events if event.status == "located"]
    return int((event_distances(events, scene).min(axis=0, initial=np.inf) > NEAR).sum())


def course_table(trials: Iterable) -> str:
    """Every line with errors of the model; empty without."""
    rows: list[Row] = [HEAD]
    own = [trial for trial in trials if trial.cell.model_error and not trial.cell.alone]
    for cell in dict.fromkeys(trial.cell for trial in own):
        courses = [trial.course for trial in own if trial.cell == cell]
        samples = max(sum(course.samples for course in courses), 1)
        several, wrong = (
            (np.mean([n > 0 for n in counts]), sum(counts) / samples)
            for counts in ([c.several for c in courses], [c.wrong for c in courses])
        )
        rows.append((
            cell.arm, str(TIERS[cell.tier]), str(cell.contacts), cell.timing, cell.motion,
            str(len(courses)), *(percent(rate) for rate in (*several, *wrong)),
        ))  # fmt: skip
    return f"{aligned(rows, text_columns=(0, 1, 3, 4))}\n{LEGEND}" if len(rows) > 1 else ""


def hands_table(trials: Iterable) -> str:
    """Every line with several contacts one after the other; empty without."""
    rows: list[Row] = [HANDS_HEAD]
    own = [t for t in trials if t.cell.contacts > 1 and t.cell.begin == "apart"]
    for cell in dict.fromkeys(trial.cell for trial in own):
        of = [trial for trial in own if trial.cell == cell]
        samples = max(sum(trial.course.samples for trial in of), 1)
        levels = np.array([touch.level for trial in of for touch in trial.touches])
        known = levels[np.isfinite(levels)]
        rows.append((
            cell.arm, str(TIERS[cell.tier]), str(cell.contacts), cell.timing, cell.motion,
            str(len(of)),
            percent(np.mean([trial.found for trial in of])),
            percent(np.mean([trial.course.false > 0 for trial in of])),
            percent(np.mean([trial.course.wrong > 0 for trial in of])),
            percent(sum(trial.course.wrong for trial in of) / samples),
            f"{np.mean([trial.events for trial in of]):.2f}",
            percent(np.mean(known < 0.9)) if len(known) else "-",
        ))  # fmt: skip
    return f"{aligned(rows, text_columns=(0, 1, 3, 4))}\n{HANDS_LEGEND}" if len(rows) > 1 else ""
