# SPDX-License-Identifier: Apache-2.0
"""One run of the localization benchmark: its touches, and what the pipeline made of them."""

from dataclasses import dataclass

import numpy as np

from touchline.bench.localization.baselines import baseline_places
from touchline.bench.localization.compatible import surface_shares
from touchline.bench.localization.course import Course, follow_course
from touchline.bench.localization.matching import distances, match
from touchline.bench.localization.touched import NEAR, Touched, judge, last_contacts
from touchline.detector.detector import Detection
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.observer import Estimate
from touchline.trials.cell import Cell
from touchline.trials.scene import (
    FRICTION,
    Scene,
    make_pipeline,
    make_scene,
    told_and_real,
)

UNKNOWNS = 10  # of two contacts


@dataclass(frozen=True)
class Trial:
    """One run: its touches, how many places the last sample names, and how many events there are.

    `rank` is the number of independent equations of a pair on one segment, which needs ten; 0
    where the touches do not share one. `baselines` are names and errors [m].
    `statuses` are those of all contacts at the last sample, `course` tells of all samples.
    """

    cell: Cell
    run: int
    q: tuple[float, ...]
    touches: tuple[Touched, ...]
    named: int
    events: int
    statuses: tuple[str, ...]
    rank: int
    course: Course
    baselines: tuple[tuple[str, tuple[float, ...]], ...] = ()
    named_surface: float = np.nan
    allowed_surface: float = np.nan

    @property
    def found(self) -> bool:
        """Every touch is found at the last sample, and nothing else is named."""
        return self.named == len(self.touches) and all(t.error < NEAR for t in self.touches)

    @property
    def event_found(self) -> bool:
        """Every touch is found as an event."""
        return all(t.event_error < NEAR for t in self.touches)

    @property
    def in_set(self) -> bool:
        """Every touch is near one of the explanations that are returned."""
        return all(touch.in_set for touch in self.touches)

    @property
    def confidently_wrong(self) -> bool:
        """As many places as touches, all of them called located, and one of them is wrong."""
        sure = all(status == "located" for status in self.statuses)
        return sure and self.named >= len(self.touches) and not self.found


def run_trial(cell: Cell, run: int, seed: int = 0, baselines: tuple[str, ...] = ()) -> Trial:
    """One run through the whole pipeline, and through the named `BASELINES`."""
    robot, _, skin = told_and_real(cell, run)
    scene = make_scene(cell, run, seed)
    pipeline = make_pipeline(robot, skin, model_error=cell.model_error)
    s = scene.signals
    estimate, detection = pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    touches = tuple(judge(pipeline, scene, with_region=cell.begin != "segments"))
    answers = last_contacts(pipeline, scene)
    named = sum(answer.position is not None for answer in answers)
    rank = pair_rank(robot, [touch.body for touch in touches])
    surfaces = (np.nan, np.nan)
    if 0 < rank < UNKNOWNS and cell.begin == "together" and not cell.speed and not cell.model_error:
        surfaces = surface_shares(skin, [t for t, _ in scene.touches], answers, FRICTION, run)
    return Trial(
        cell,
        run,
        tuple(scene.touches[0][0].q),
        touches,
        named,
        len(pipeline.events),
        tuple(str(answer.status) for answer in answers),
        rank,
        follow_course(pipeline, scene),
        tuple(
            (name, errors)
            for name in baselines
            if (errors := _baseline(name, skin, scene, estimate, detection, run)) is not None
        ),
        *surfaces,
    )


def _baseline(
    name: str, skin: Skin, scene: Scene, estimate: Estimate, detection: Detection, run: int
) -> tuple[float, ...] | None:
    """Errors [m] of a baseline, one per touch; NaN where it names too few places."""
    named = baseline_places(name, skin, scene.signals, estimate, detection, run)
    if named is None:
        return None
    apart = distances(scene.places[:, -1], named)
    mine = match(apart)
    return tuple(np.nan if k is None else float(apart[i, k]) for i, k in enumerate(mine))


def pair_rank(robot: Robot, bodies: list[str]) -> int:
    """Independent equations for a contact on each of two bodies of one segment, 0 for others.

    Six of the segment's sensor and one for each joint between the two that has a sensor of its
    own; two contacts need ten (one has five unknowns).
    """
    if len(bodies) != 2:
        return 0
    first, second = (robot.body_of(name) for name in bodies)
    if first.segment != second.segment:
        return 0
    between = set(robot.joints_inboard_of(first)) ^ set(robot.joints_inboard_of(second))
    own = {j.name for j in robot.description.joints if j.measured}
    return 6 + len(between & own)
