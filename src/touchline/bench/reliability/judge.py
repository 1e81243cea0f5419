# SPDX-License-Identifier: Apache-2.0
"""What a pipeline made of a faulty recording, beside what it makes of the healthy one."""

from dataclasses import dataclass
from time import perf_counter

import numpy as np

from touchline.arrays import Array
from touchline.health import Health
from touchline.observer.observer import Estimate
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.result.kinds import ContactLevel, Fault
from touchline.trials.faults import Channel, FaultType, injected
from touchline.trials.recordings import PUSHED, RELEASED, Recording

SURE = 0.9  # probability of a body: a confident link
SAME = 0.02  # s by which the times of an event may differ
# Bits that tell of no fault by themselves.
SILENT = Health.SETTLING | Health.PERIOD | Health.NO_ROOM | Health.OFFSET | Health.NOISY
TELLS = np.uint32(sum(bit for bit in Health if bit not in SILENT))
# What the arm shows over many seconds: no fault of a moment begins it or ends it.
LASTING = np.uint32(Health.OFFSET | Health.NOISY)


@dataclass(frozen=True)
class Said:
    """What a pipeline said of a recording."""

    estimate: Estimate
    events: list[Event]
    named: dict[str, int]  # channels, and the sample since which each is said to be faulty


@dataclass(frozen=True)
class Outcome:
    """One faulty recording.

    Attributes:
        robot, fault, channel, phase: what it was.
        crash: what was raised; empty: nothing.
        finite: settled estimates are numbers.
        told: after how long the fault was told [s]; inf: never.
        named: the channel itself was named, or the sample was told as absent.
        harmless: events are those of the healthy recording.
        phantoms: events that the healthy recording does not have, at no level.
        again: of those, events that began during the push: it was told twice or late.
        weaker: events of the healthy recording that are told as a contact, not as a collision.
        collisions: of the phantoms, those that became a collision while nothing touched the arm, or
            where the healthy recording has no collision.
        wrong: events with a sure body that is neither the touched one nor what the healthy
            recording says as surely.
        lost: events of the healthy recording that are missing.
        recovery: after the fault's end until health is as without it, offsets and noise apart [s].
        seconds: that it took.
    """

    robot: str
    fault: FaultType
    channel: Channel
    phase: str
    crash: str = ""
    finite: bool = True
    told: float = np.inf
    named: bool = False
    harmless: bool = False
    phantoms: int = 0
    again: int = 0
    weaker: int = 0
    collisions: int = 0
    wrong: int = 0
    lost: int = 0
    recovery: float = np.nan
    seconds: float = 0.0

    @property
    def told_in_time(self) -> bool:
        """Told soon enough, or harmless."""
        return self.harmless or self.told <= self.fault.within


def listen(pipeline: Pipeline, samples: Samples) -> Said:
    """Runs a recording through a pipeline that forgets all others."""
    pipeline.reset()
    before = len(pipeline.events)
    estimate, _ = pipeline.run(samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
    named: dict[str, int] = {}
    for change in pipeline.faults:
        if change.fault != Fault.NONE:
            named.setdefault(change.channel, change.sample)
    return Said(estimate, pipeline.events[before:], named)


def judge(
    pipeline: Pipeline,
    recording: Recording,
    healthy: Said,
    fault: FaultType,
    channel: Channel,
    phase: tuple[str, float],
) -> Outcome:
    """Puts a fault into a recording and says what came of it."""
    name, begin = phase
    key = [recording.seed, hash_of(fault.name, channel.name, name)]
    rng = np.random.default_rng(key)
    faulty, end = injected(recording.samples, fault, channel, begin, rng)
    robot = recording.robot.name
    clock = perf_counter()
    try:
        said = listen(pipeline, faulty)
    except Exception as error:  # whatever it is: that is what is counted
        return Outcome(robot, fault, channel, name, crash=repr(error))
    seconds = perf_counter() - clock
    first = int(np.searchsorted(recording.samples.time, begin - 1e-9))
    time = recording.samples.time
    tells = (said.estimate.health & ~healthy.estimate.health & TELLS) != 0
    told = np.flatnonzero(tells[first:])
    news = [e for e in said.events if not any(_same(e, other) for other in healthy.events)]
    lost = [e for e in healthy.events if not any(_same(other, e) for other in said.events)]
    weaker = [e for e in news if any(_weaker(e, other) for other in lost)]
    phantoms = [e for e in news if e not in weaker]
    lost = [e for e in lost if not any(_weaker(other, e) for other in weaker)]
    sure = [e for e in news if _sure(e)]
    bodies = {recording.body, *(e.body for e in healthy.events if _sure(e))}
    hard = any(e.level == ContactLevel.COLLISION for e in healthy.events)
    return Outcome(
        robot,
        fault,
        channel,
        name,
        finite=_finite(said.estimate),
        told=float(time[first + told[0]] - time[first]) if len(told) else np.inf,
        named=any(c.startswith(channel.name) for c in said.named) or fault.group.startswith("abs"),
        harmless=not news and not lost,
        phantoms=len(phantoms),
        again=sum(map(_in_push, phantoms)),
        weaker=len(weaker),
        collisions=sum(
            e.level == ContactLevel.COLLISION and not (hard and _hits_in_push(e)) for e in phantoms
        ),
        wrong=sum(e.body not in bodies for e in sure),
        lost=len(lost),
        recovery=_recovery(said, healthy, time, end),
        seconds=seconds,
    )


def hash_of(*words: str) -> int:
    """A number that is the same in each process."""
    value = 5381
    for letter in " ".join(words):
        value = (33 * value + ord(letter)) % (1 << 31)
    return value


def _sure(event: Event) -> bool:
    known = event.body is not None and event.status == "located"
    return known and (event.body_probability or 0.0) >= SURE


def _in_push(event: Event) -> bool:
    return PUSHED <= event.detected <= RELEASED


def _hits_in_push(event: Event) -> bool:
    return PUSHED <= (event.decided or event.detected) <= RELEASED


def _same(event: Event, other: Event) -> bool:
    return event.level == other.level and _at_once(event, other)


def _weaker(event: Event, other: Event) -> bool:
    return other.level == ContactLevel.COLLISION != event.level and _at_once(event, other)


def _at_once(event: Event, other: Event) -> bool:
    return event.segment == other.segment and abs(event.detected - other.detected) <= SAME


def _finite(estimate: Estimate) -> bool:
    """Are all wrenches of segments that are settled numbers?"""
    bad = ~np.isfinite(estimate.segment_wrench).all(axis=2)
    bad &= np.isfinite(estimate.segment_wrench).any(axis=(0, 2))  # those that are ever known
    return not bool((bad & estimate.segment_settled.astype(bool)).any())


def _recovery(said: Said, healthy: Said, time: Array, end: float) -> float:
    after = time > end
    differs = ((said.estimate.health ^ healthy.estimate.health) & ~LASTING != 0)[after]
    late = np.flatnonzero(differs)
    return float(time[after][late[-1]] - end) if len(late) else 0.0
