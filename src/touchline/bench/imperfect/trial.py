# SPDX-License-Identifier: Apache-2.0
"""A push on an arm that is not as told, and what is said of it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import count

import numpy as np

from touchline.arrays import Array
from touchline.bench.imperfect.faults import Fault
from touchline.bench.localization.credibility import credibility
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact
from touchline.result.event import Event
from touchline.result.kinds import Status
from touchline.trials.free_motion import MotionMaker, Trajectory, random_trajectory
from touchline.trials.touches import Touch, TouchSampler

RATE = 1000.0  # Hz
SECONDS = 3.5  # of a trial
BEGIN, END, RISE = 1.5, 2.3, 0.05  # s, of the push
FORCE = 20.0  # N
SPEED = 1.0  # rad/s, of the fastest joint of an arm that moves
LATE = 0.3  # s, after which a touch that is over must have ended
NEAR = 0.05  # m; a located place further off is wrong


@dataclass(frozen=True)
class Outcome:
    """What was said of one trial.

    Attributes:
        before: was a contact located before the touch?
        found: does an event begin within the touch, or last from before to the touch's end?
        wrong: is an event of the touch located more than `NEAR` off, or without any touch?
        cleared: has all ended `LATE` after the touch?
        events: how many began.
        level: probability of the smallest region that holds the place, of the contact that is told
            at the push's end (`credibility`); NaN: none with a place.
    """

    before: bool
    found: bool
    wrong: bool
    cleared: bool
    events: int
    level: float


class Trials:
    """Trials of one arm.

    Args:
        robot: as told.
    """

    def __init__(self, robot: Robot) -> None:
        self._robot, self._skin = robot, Skin(robot)
        self._segments = tuple(s for s in robot.segment_names if s != "root") or None

    def play(self, fault: Fault, moving: bool, seed: tuple[int, ...]) -> Outcome:
        """One push in a random pose or a random motion."""
        rng = np.random.default_rng(seed)
        arm = fault.moving(self._robot, rng)
        trajectory = _scaled(random_trajectory(self._robot, rng), SPEED if moving else 0.0)
        maker = MotionMaker(self._robot, arm, RATE, SECONDS)
        q, qd, loads = maker.loads(trajectory)
        touch = self._touch(q[round(BEGIN * RATE)], rng)
        path = self._path(touch, q)
        force = _course(maker.time)[:, None] * touch.force
        wrench = np.hstack([force, np.cross(path, force)])
        contact = contact_loads(self._robot, q, touch.patch.link, wrench)
        n = q.shape[1]
        loads[:, :n] -= contact.torque
        loads[:, n:] -= contact.wrench.reshape(len(q), -1)
        s = fault.read(self._robot, maker.sensed(q, qd, loads, rng), rng)
        pipeline = Pipeline(self._robot, period=1.0 / RATE, skin=self._skin)
        first, last = round(BEGIN * RATE), round(END * RATE) - 1
        columns = (s.time, s.q, s.qd, s.tau, s.wrench)
        pipeline.run(*(column[:first] for column in columns))
        before = any(event.status == Status.LOCATED for event in pipeline.events)
        pipeline.run(*(column[first:last] for column in columns))
        told = pipeline.update(*(column[last] for column in columns)).contacts
        level = _level(told, touch.patch.body, path[last])
        pipeline.run(*(column[last + 1 :] for column in columns))
        return _judged(pipeline.events, before, maker.time, path, level)

    def _touch(self, q: Array, rng: np.random.Generator) -> Touch:
        sampler = TouchSampler(self._skin, rng, self._segments, floor=-10.0)
        for _ in count():
            touch = sampler.attempt(FORCE, q)
            if touch is not None:
                return touch
        raise AssertionError("unreachable")

    def _path(self, touch: Touch, q: Array) -> Array:
        """Where the touched point of the link is at each sample (N, 3) [m]; the force stays."""
        node = touch.patch.node
        poses = np.array([self._robot.poses(x)[node] for x in q])
        T = self._robot.poses(touch.q)[node]
        local = T[:3, :3].T @ (touch.position - T[:3, 3])
        return np.asarray(poses[:, :3, :3] @ local + poses[:, :3, 3], dtype=np.float64)


def _course(time: Array) -> Array:
    up, down = (time - BEGIN) / RISE, (time - END) / RISE
    return np.clip(up, 0.0, 1.0) - np.clip(down, 0.0, 1.0)


def _scaled(trajectory: Trajectory, speed: float) -> Trajectory:
    """At a steady pace, with `speed` [rad/s] the most that its fastest joint reaches."""
    most = (trajectory.amplitude * trajectory.frequency).sum(axis=0).max()
    return replace(trajectory, amplitude=trajectory.amplitude * speed / most)


def _level(told: Sequence[Contact], body: str, place: Array) -> float:
    """Of the first contact with a place."""
    levels = [credibility(contact, body, place) for contact in told]
    return next((level for level in levels if np.isfinite(level)), np.nan)


def _judged(events: list[Event], before: bool, time: Array, path: Array, level: float) -> Outcome:
    end = END + RISE
    own = [e for e in events if BEGIN <= e.detected <= end]
    over = [e for e in events if e.detected < BEGIN and _ended(e) > end]
    return Outcome(
        before=before,
        found=bool(own or over),
        wrong=any(_wrong(e, time, path) for e in events),
        cleared=all(_ended(e) <= end + LATE for e in events if e.detected <= end),
        events=len(events),
        level=level,
    )


def _ended(event: Event) -> float:
    return np.inf if event.cleared is None else event.cleared


def _wrong(event: Event, time: Array, path: Array) -> bool:
    """Is it located where nothing touches?"""
    if event.status != Status.LOCATED or event.position is None:
        return False
    at = event.time_of_position
    if at is None or at < BEGIN or event.detected > END + 2 * RISE:
        return True
    place = path[min(int(np.searchsorted(time, at)), len(path) - 1)]
    return float(np.linalg.norm(event.position - place)) > NEAR
