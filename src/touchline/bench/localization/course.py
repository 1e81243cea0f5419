# SPDX-License-Identifier: Apache-2.0
"""What is said of the touches of a run in all samples, not only in the last one."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from touchline.bench.localization.arm import TIERS
from touchline.bench.localization.columns import percent
from touchline.bench.localization.moving import carried
from touchline.bench.localization.scene import Scene
from touchline.bench.localization.touched import NEAR
from touchline.bench.tables import Row, aligned
from touchline.pipeline.pipeline import Pipeline

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


@dataclass(frozen=True)
class Course:
    """What was said from soon after the last onset on.

    Attributes:
        samples: that name a contact.
        several: of them that name more contacts than there are, or one as `not_separable`.
        wrong: of them with a place that is `located` farther than `NEAR` from every touch.
    """

    samples: int
    several: int
    wrong: int


def follow_course(pipeline: Pipeline, scene: Scene) -> Course:
    """Of a run whose recording was one part."""
    robot, signals, table = pipeline.robot, scene.signals, pipeline.contacts
    begin = max(onset for _, onset in scene.touches) + SHOWN
    late = signals.time[table.sample] >= begin
    sample, status = table.sample[late], table.columns()["status"][late]
    if not len(sample):
        return Course(0, 0, 0)
    sample = sample - sample[0]
    q = signals.q[table.sample[late][0] :]
    count = np.bincount(sample)
    several = count > len(scene.touches)
    several[sample[status == "not_separable"]] = True
    places = np.array([carried(robot, touch, q)[0] for touch, _ in scene.touches])
    off = np.linalg.norm(places[:, sample] - table.position[late], axis=2).min(axis=0) > NEAR
    wrong = np.unique(sample[off & (status == "located")])
    return Course(int((count > 0).sum()), int(several.sum()), len(wrong))


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
