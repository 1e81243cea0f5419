# SPDX-License-Identifier: Apache-2.0
"""One run of the localization benchmark: touches, signals, the pipeline, and what it made of them.

Everything random follows from the seed, the cell and the number of the run, so that the result
does not depend on how runs are spread over processes.
"""

from contextlib import suppress
from dataclasses import astuple, dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from touchline.bench.localization.arm import load_arm
from touchline.bench.localization.baselines import baseline_places
from touchline.bench.localization.credibility import credibility
from touchline.bench.localization.matching import distances, match
from touchline.bench.localization.moving import carried, moving_signals
from touchline.bench.touches import Signals, Touch, TouchSampler, resting_signals
from touchline.contact.answer import Answer
from touchline.contact.detector import Detection
from touchline.contact.event import Event
from touchline.contact.pipeline import Pipeline
from touchline.contact.skin import Skin
from touchline.estimation.observer import Estimate
from touchline.model.robot import Robot

Array = NDArray[np.float64]

FORCE = 20.0  # N
NEAR, GROSS = 0.0225, 0.1  # m: what counts as found, and as grossly wrong
FIRST, APART = 0.55, 0.1  # s: the first onset, after settling and a quiet half second, then each
FRICTION = 0.5
FAST = 0.2  # m/s: slower contacts tell nothing of lag


@dataclass(frozen=True)
class Cell:
    """What is varied.

    Attributes:
        arm: name of the arm.
        contacts: how many.
        tier: of noise.
        together: all begin at the same instant; otherwise 0.1 s apart.
        speed: of every joint [rad/s]; 0: at rest.
    """

    arm: str
    contacts: int = 1
    tier: int = 0
    together: bool = False
    speed: float = 0.0


@dataclass(frozen=True)
class Touched:
    """One of a run's touches and what was made of it; NaN and "" where nothing was located.

    Attributes:
        link: the touched link, `body` its rigid body, x, y, z the point in the link's frame [m].
        error: distance of the located point from the true one at the last sample [m].
        force_error: of the force [N].
        found_link: that was named, on `found_body`.
        status: of the contact that was matched with this touch.
        std: root of the trace of its covariance [m].
        level: probability of the smallest credible region that holds the truth: `Region.level` of
            a single contact, `credibility` of one of several.
        event_error: distance of the event's position at its own time [m].
        event_body: of the event.
        candidate: probability of the best candidate within reach of the truth; 0: there is none.
        candidate_error: distance of the candidate nearest to the truth [m].
        lag: of an arm in motion, `error` in parts of |v| / K: the way that a point with the speed
            |v| across its force is seen behind its place without compensation; NaN below `FAST`.
    """

    link: str
    body: str
    x: float
    y: float
    z: float
    error: float = np.nan
    force_error: float = np.nan
    found_link: str = ""
    found_body: str = ""
    status: str = "missed"
    std: float = np.nan
    level: float = np.nan
    event_error: float = np.nan
    event_body: str = ""
    candidate: float = 0.0
    candidate_error: float = np.nan
    lag: float = np.nan


@dataclass(frozen=True)
class Trial:
    """One run: its touches, how many places the last sample names, and how many events there are.

    `rank` is the number of independent equations of a pair on one segment, which needs ten; 0
    where the touches do not share one. `baselines` are names and errors [m].
    `statuses` are those of all contacts at the last sample.
    """

    cell: Cell
    run: int
    q: tuple[float, ...]
    touches: tuple[Touched, ...]
    named: int
    events: int
    statuses: tuple[str, ...]
    rank: int
    baselines: tuple[tuple[str, tuple[float, ...]], ...] = ()

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
        return all(t.error < NEAR or t.candidate > 0 for t in self.touches)

    @property
    def confidently_wrong(self) -> bool:
        """As many places as touches, all of them called located, and one of them is wrong."""
        sure = all(status == "located" for status in self.statuses)
        return sure and self.named >= len(self.touches) and not self.found


@dataclass(frozen=True)
class Scene:
    """The touches of a run with their onsets [s], and the signals they make.

    Forces are constant in world, or turn with their links (`turning`).
    """

    touches: list[tuple[Touch, float]]
    signals: Signals
    turning: bool = False


@lru_cache(maxsize=8)
def arm_and_skin(arm: str, tier: int) -> tuple[Robot, Skin]:
    """An arm and its surfaces, kept from run to run."""
    robot = load_arm(arm, tier)
    return robot, Skin(robot)


def make_scene(cell: Cell, run: int, seed: int = 0) -> Scene:
    """The touches and signals of one run; tiers and timing do not change pose and places."""
    robot, skin = arm_and_skin(cell.arm, cell.tier)
    chance = np.random.default_rng([seed, run, cell.contacts, *cell.arm.encode()])
    touches = TouchSampler(skin, chance, friction=FRICTION).sample_several(cell.contacts, FORCE)
    step = 0.0 if cell.together else APART
    onsets = [(touch, FIRST + i * step) for i, touch in enumerate(touches)]
    duration = onsets[-1][1] + APART
    noise = np.random.default_rng([seed, run, cell.tier, 1]) if cell.tier else None
    if not cell.speed:
        return Scene(onsets, resting_signals(robot, touches[0].q, onsets, duration, noise))
    # Where the arm turns fast, a force that is constant in world soon leaves its friction cone; but
    # contacts on one segment are told apart by forces that do not all change.
    turning = cell.contacts == 1
    signals = moving_signals(robot, onsets, duration, cell.speed, chance, noise, turning=turning)
    return Scene(onsets, signals, turning)


def run_trial(cell: Cell, run: int, seed: int = 0, baselines: tuple[str, ...] = ()) -> Trial:
    """One run through the whole pipeline, and through the named `BASELINES`."""
    robot, skin = arm_and_skin(cell.arm, cell.tier)
    scene = make_scene(cell, run, seed)
    pipeline = make_pipeline(robot, skin)
    s = scene.signals
    estimate, detection = pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    touches = tuple(_judge(pipeline, scene))
    answers = _last_answers(pipeline, scene)
    named = sum(answer.position is not None for answer in answers)
    return Trial(
        cell,
        run,
        tuple(scene.touches[0][0].q),
        touches,
        named,
        len(pipeline.events),
        tuple(answer.status or "" for answer in answers),
        pair_rank(robot, [touch.body for touch in touches]),
        tuple(
            (name, errors)
            for name in baselines
            if (errors := _baseline(name, skin, scene, estimate, detection, run)) is not None
        ),
    )


def _baseline(
    name: str, skin: Skin, scene: Scene, estimate: Estimate, detection: Detection, run: int
) -> tuple[float, ...] | None:
    """Errors [m] of a baseline, one per touch; NaN where it names too few places."""
    named = baseline_places(name, skin, scene.signals, estimate, detection, run)
    if named is None:
        return None
    apart = distances(true_places(skin.robot, scene, scene.signals.q[-1]), named)
    mine = match(apart)
    return tuple(np.nan if k is None else float(apart[i, k]) for i, k in enumerate(mine))


def make_pipeline(robot: Robot, skin: Skin, rule: str = "likelihood") -> Pipeline:
    """The pipeline as the benchmark uses it.

    It is told what is true of the benchmark: errors are those of the noise figures alone, and how
    large the friction cone is.
    """
    return Pipeline(robot, skin=skin, rule=rule, torque_error=0.0, friction=FRICTION)


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


def true_places(robot: Robot, scene: Scene, q: Array) -> Array:
    """The touched points (m, 3) [m] in world at joint positions `q` (n,)."""
    start, now = robot.poses(scene.touches[0][0].q), robot.poses(q)
    places = []
    for touch, _ in scene.touches:
        node = touch.patch.node
        local = start[node][:3, :3].T @ (touch.position - start[node][:3, 3])
        places.append(now[node][:3, :3] @ local + now[node][:3, 3])
    return np.array(places)


def _last_answers(pipeline: Pipeline, scene: Scene) -> list[Answer]:
    table = pipeline.contacts
    last = table.answers[table.sample == len(scene.signals.time) - 1]
    return [pipeline.localizer.answer(row) for row in last]


def _judge(pipeline: Pipeline, scene: Scene) -> list[Touched]:
    robot, signals = pipeline.robot, scene.signals
    places = true_places(robot, scene, signals.q[-1])
    answers = _last_answers(pipeline, scene)
    mine = match(distances(places, [answer.position for answer in answers]))
    apart = _event_distances(pipeline.events, robot, scene)
    my_event = match(apart)
    judged = []
    for i, (touch, _) in enumerate(scene.touches):
        about: dict[str, Any] = {}
        if (k := my_event[i]) is not None:
            body = pipeline.events[k].body or ""
            about |= {"event_error": float(apart[i, k]), "event_body": body}
        if (k := mine[i]) is not None:
            about |= _of_answer(answers[k], touch, places[i])
            about |= _in_motion(answers[k], robot, scene, touch)
            if len(answers) == 1:
                with suppress(ValueError):  # else as of a known contact, from its covariance
                    region = pipeline.localizer.region()
                    about["level"] = region.level(touch.patch.link, places[i])
        about |= _of_candidates(answers, touch, places[i])
        here = touch.patch
        T = robot.poses(touch.q)[here.node] @ here.T_node_link
        x, y, z = (T[:3, :3].T @ (touch.position - T[:3, 3])).tolist()
        judged.append(Touched(here.link, here.body, x, y, z, **about))
    return judged


def _event_distances(events: list[Event], robot: Robot, scene: Scene) -> Array:
    """Distances (m, k) [m] of the events' positions from the places at their times."""
    signals, columns = scene.signals, []
    for event in events:
        time = np.inf if event.time_of_position is None else event.time_of_position
        row = min(int(np.searchsorted(signals.time, time)), len(signals.time) - 1)
        places = true_places(robot, scene, signals.q[row])
        columns.append(distances(places, [event.position])[:, 0])
    return np.array(columns).reshape(len(events), len(scene.touches)).T


def _of_answer(answer: Answer, touch: Touch, place: Array) -> dict:
    """What is said of a touch by an answer with a position."""
    covariance = np.full((3, 3), np.nan) if answer.covariance is None else answer.covariance
    position, force = (
        np.full(3, np.nan) if x is None else x for x in (answer.position, answer.force)
    )
    return {
        "error": float(np.linalg.norm(position - place)),
        "force_error": float(np.linalg.norm(force - touch.force)),
        "found_link": answer.link or "",
        "found_body": answer.body or "",
        "status": answer.status or "",
        "std": float(np.sqrt(np.trace(covariance))),
        "level": credibility(answer, touch.patch.body, place),
    }


def _in_motion(answer: Answer, robot: Robot, scene: Scene, touch: Touch) -> dict:
    """Lag, and the error of a force that has turned with its link, on an arm in motion."""
    s = scene.signals
    points, forces = carried(robot, touch, s.q[-2:])
    force = forces[-1] if scene.turning else touch.force
    about: dict[str, float] = {}
    if answer.force is not None:
        about["force_error"] = float(np.linalg.norm(answer.force - force))
    velocity = (points[1] - points[0]) / (s.time[-1] - s.time[-2])
    along = force / np.linalg.norm(force)
    speed = float(np.linalg.norm(velocity - along * (along @ velocity)))
    if answer.position is not None and touch.patch.segment is not None and speed > FAST:
        error = float(np.linalg.norm(answer.position - points[1]))
        about["lag"] = error * robot.description.bandwidth_sensors[touch.patch.segment] / speed
    return about


def _of_candidates(answers: list[Answer], touch: Touch, place: Array) -> dict:
    known = [k for answer in answers for k in answer.candidates if k.body == touch.patch.body]
    if not known:
        return {}
    errors = [float(np.linalg.norm(k.position - place)) for k in known]
    near = [
        k.probability
        for k, error in zip(known, errors, strict=True)
        if error < max(NEAR, k.radius)  # a candidate may stand for a part of its link
    ]
    return {"candidate": max(near, default=0.0), "candidate_error": min(errors)}


def flat(trial: Trial) -> list[dict]:
    """One row per touch, for a table."""
    cell = dict(
        zip(("arm", "contacts", "tier", "together", "speed"), astuple(trial.cell), strict=True)
    )
    common = {
        "run": trial.run,
        "rank": trial.rank,
        "named": trial.named,
        "events": trial.events,
        "found": trial.found,
    }
    rows = []
    for i, touch in enumerate(trial.touches):
        other = {f"error_{name}": errors[i] for name, errors in trial.baselines}
        rows.append({**cell, **common, "contact": i, **vars(touch), **other})
    return rows
