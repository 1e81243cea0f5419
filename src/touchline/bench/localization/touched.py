# SPDX-License-Identifier: Apache-2.0
"""What the pipeline made of each touch of a run."""

from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.bench.localization.credibility import credibility
from touchline.bench.localization.matching import distances, match
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact
from touchline.result.event import Event
from touchline.trials.scene import Scene
from touchline.trials.touches import Touch

NEAR, GROSS = 0.0225, 0.1  # m: what counts as found, and as grossly wrong
FAST = 0.2  # m/s: slower contacts tell nothing of lag


@dataclass(frozen=True)
class Touched:
    """One of a run's touches and what was made of it; NaN and "" where nothing was located.

    Attributes:
        link: the touched link, `body` its rigid body on `segment`, x, y, z the point in the link's
            frame [m].
        on_segment: how many places are named on that segment at the last sample.
        error: distance of the located point from the true one at the last sample [m].
        force_error: of the force [N].
        found_link: that was named, on `found_body`.
        status: of the contact that was matched with this touch.
        std: root of the trace of its covariance [m].
        level: probability of the smallest credible region that holds the truth: `Region.level` of
            a single contact, `credibility` of one of several and of those on different segments.
        event_error: distance of the event's position at its own time [m].
        event_body: of the event.
        candidate: probability of the best candidate within reach of the truth; 0: there is none.
        candidate_error: distance of the candidate nearest to the truth [m].
        lag: of an arm in motion, `error` in parts of |v| / K: the way that a point with the speed
            |v| across its force is seen behind its place without compensation; NaN below `FAST`.
    """

    link: str
    body: str
    segment: str
    on_segment: int
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

    @property
    def found(self) -> bool:
        """It is found at the last sample, and nothing else is named on its segment."""
        return self.on_segment == 1 and self.error < NEAR

    @property
    def in_set(self) -> bool:
        """It is near one of the explanations that are returned."""
        return self.error < NEAR or self.candidate > 0

    @property
    def surely_wrong(self) -> bool:
        """A place for it is called located, and is wrong."""
        return self.status == "located" and not self.error < NEAR


def last_contacts(pipeline: Pipeline, scene: Scene) -> list[Contact]:
    """What is said of each contact at the last sample."""
    table = pipeline.contacts
    last = np.flatnonzero(table.sample == len(scene.signals.time) - 1)
    return [table[row] for row in last.tolist()]


def judge(pipeline: Pipeline, scene: Scene, with_region: bool) -> list[Touched]:
    """Every touch of a scene that the pipeline has taken.

    Args:
        pipeline: after all samples.
        scene: that it took.
        with_region: the posterior of a single contact is worked out for its `level`.
    """
    robot = pipeline.robot
    places = scene.places[:, -1]
    answers = last_contacts(pipeline, scene)
    mine = match(distances(places, [answer.position for answer in answers]))
    apart = event_distances(pipeline.events, scene)
    my_event = match(apart)
    judged = []
    for i, (touch, _) in enumerate(scene.touches):
        about = _where(robot, touch)
        on_segment = [a for a in answers if a.segment == about["segment"]]
        about["on_segment"] = sum(answer.position is not None for answer in on_segment)
        if (k := my_event[i]) is not None:
            body = pipeline.events[k].body or ""
            about |= {"event_error": float(apart[i, k]), "event_body": body}
        if (k := mine[i]) is not None:
            about |= _of_answer(answers[k], touch, places[i], scene.forces[i, -1])
            about |= _in_motion(answers[k], robot, scene, i)
            if with_region and len(answers) == 1:
                with suppress(ValueError):  # else as of a known contact, from its covariance
                    region = pipeline.region()
                    about["level"] = region.level(touch.patch.link, places[i])
        about |= _of_candidates(answers, touch, places[i])
        judged.append(Touched(**about))
    return judged


def _where(robot: Robot, touch: Touch) -> dict[str, Any]:
    here = touch.patch
    T = robot.poses(touch.q)[here.node] @ here.T_node_link
    x, y, z = (T[:3, :3].T @ (touch.position - T[:3, 3])).tolist()
    return {"link": here.link, "body": here.body, "segment": here.segment, "x": x, "y": y, "z": z}


def event_distances(events: list[Event], scene: Scene) -> Array:
    """Distances (m, k) [m] of the events' positions from the places at their times."""
    time, columns = scene.signals.time, []
    for event in events:
        at = np.inf if event.time_of_position is None else event.time_of_position
        row = min(int(np.searchsorted(time, at)), len(time) - 1)
        columns.append(distances(scene.places[:, row], [event.position])[:, 0])
    return np.array(columns).reshape(len(events), len(scene.touches)).T


def _of_answer(answer: Contact, touch: Touch, place: Array, true: Array) -> dict:
    """What is said of a touch by an answer with a position."""
    covariance = np.full((3, 3), np.nan) if answer.covariance is None else answer.covariance
    position, force = (
        np.full(3, np.nan) if x is None else x for x in (answer.position, answer.force)
    )
    return {
        "error": float(np.linalg.norm(position - place)),
        "force_error": float(np.linalg.norm(force - true)),
        "found_link": answer.link or "",
        "found_body": answer.body or "",
        "status": str(answer.status),
        "std": float(np.sqrt(np.trace(covariance))),
        "level": credibility(answer, touch.patch.body, place),
    }


def _in_motion(answer: Contact, robot: Robot, scene: Scene, i: int) -> dict:
    """Lag of touch `i` on an arm in motion."""
    time, points = scene.signals.time, scene.places[i, -2:]
    touch, force = scene.touches[i][0], scene.forces[i, -1]
    velocity = (points[1] - points[0]) / (time[-1] - time[-2])
    along = force / np.linalg.norm(force)
    speed = float(np.linalg.norm(velocity - along * (along @ velocity)))
    if answer.position is None or touch.patch.segment is None or speed <= FAST:
        return {}
    error = float(np.linalg.norm(answer.position - points[1]))
    return {"lag": error * robot.description.bandwidth_sensors[touch.patch.segment] / speed}


def _of_candidates(answers: list[Contact], touch: Touch, place: Array) -> dict:
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
