# SPDX-License-Identifier: Apache-2.0
"""The scenarios of the wrench benchmark, and how each is judged."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from touchline.bench.wrench.log import Log
from touchline.bench.wrench.stage import (
    BIAS,
    CALM,
    DISTURBANCE,
    IMPACT,
    PAUSE,
    PAYLOAD,
    PUSH,
    SPEED,
    START,
    Stage,
)

ACCELERATIONS = (2.0, 8.0, 20.0, 30.0)  # [rad/s2]; beyond, torque sensors saturate
SWEEP = ("link0", "link1", "link2", "link3", "link4", "link5", "link6", "link7", "tool", "handle")
STRUCK = ("link4", "tool", "handle")  # one on each segment
DURATIONS = (0.005, 0.010, 0.020)  # of impacts [s]
ENCODERS = (1e-5, 3e-5, 1e-4)  # [rad]
SLOW = 16  # steps of the physics from one sample to the next at 250 Hz


@dataclass(frozen=True)
class Scene:
    """One log of a scenario.

    Attributes:
        name: the link that is pushed where a scenario has a log for each; else empty.
        log: what happened.
        onsets: segments that are struck, and when [s].
    """

    name: str
    log: Log
    onsets: Sequence[tuple[str, float]] = ()


@dataclass(frozen=True)
class Scenario:
    """Logs that are judged together.

    Attributes:
        name: of the scenario.
        says: what happens.
        scenes: its logs, recorded when called.
        touched: whether something touches; where not, bandwidths have a lower limit.
        window: from when to when errors count [s].
    """

    name: str
    says: str
    scenes: Callable[[], list[Scene]] = field(repr=False)
    touched: bool = True
    window: tuple[float, float] = (START, np.inf)


def scenarios(stage: Stage) -> list[Scenario]:
    """All of them, in the order of the tables."""
    return [*_free(stage), *_touched(stage), *_impacts(stage), *_faults(stage), *_sampling(stage)]


def _one(make: Callable[..., Log], *arguments: object) -> Callable[[], list[Scene]]:
    return lambda: [Scene("", make(*arguments))]


def _free(stage: Stage) -> list[Scenario]:
    found = []
    for title, window, says in (
        ("free", (START, np.inf), f"nothing touches; the first {START:g} s are left out"),
        ("start-up", (0.0, START), f"the same, only the first {START:g} s; the arm moves already"),
    ):
        found += [
            Scenario(f"{title}, {a:g} rad/s2", says, _one(stage.free, a), False, window)
            for a in ACCELERATIONS
        ]
    ideal = _one(stage.free, 20.0, None)
    found.append(Scenario("ideal, 20 rad/s2", "free, with ideal sensors", ideal, False))
    says = "the arm rests, then moves with this acceleration at once"
    found.append(Scenario("set off, 20 rad/s2", says, _one(stage.set_off, 20.0), False))
    return found


def _touched(stage: Stage) -> list[Scenario]:
    sweep = [lambda link=link: Scene(link, stage.push(link)) for link in SWEEP]
    moving = f"on an arm that moves at {SPEED:g} rad/s"
    return [
        Scenario(
            "one push",
            f"{PUSH:g} N for 0.5 s on {len(SWEEP)} links in turn, {moving}",
            lambda: [make() for make in sweep],
        ),
        Scenario(
            "three pushes",
            f"{PUSH:g} N on link4, tool and handle, begun one after the other, {moving}",
            _one(stage.three_pushes),
        ),
    ]


def _impacts(stage: Stage) -> list[Scenario]:
    def scenes(duration: float) -> list[Scene]:
        log, onsets = stage.impacts(duration, STRUCK)
        segments = [(stage.robot.body_of(link).segment, onset) for link, onset in onsets]
        return [Scene("", log, segments)]

    return [
        Scenario(
            f"impacts, {1e3 * duration:g} ms",
            f"half sines of {IMPACT:g} N on {', '.join(STRUCK)} in turn, {PAUSE:g} s apart",
            lambda duration=duration: scenes(duration),
        )
        for duration in DURATIONS
    ]


def _faults(stage: Stage) -> list[Scenario]:
    force, moment = np.linalg.norm(BIAS[:3]), np.linalg.norm(BIAS[3:])
    return [
        Scenario(
            "disturbed joint 5",
            f"free at {CALM:g} rad/s2; joint 5's sensor misses {DISTURBANCE:g} Nm at 1 Hz",
            _one(stage.disturbed),
            False,
        ),
        Scenario(
            f"payload, +{PAYLOAD:g} kg",
            f"free at {CALM:g} rad/s2, the tool heavier than the model says",
            _one(stage.payload),
            False,
        ),
        Scenario(
            "biased wrist sensor",
            f"free at {CALM:g} rad/s2, the wrist sensor off by {force:.1f} N and {moment:.2f} Nm",
            _one(stage.biased),
            False,
        ),
    ]


def _sampling(stage: Stage) -> list[Scenario]:
    def every(steps: int) -> Log:
        return stage.three_pushes(np.arange(0, len(stage.three.readings.time), steps))

    def jittered() -> Log:
        return stage.three_pushes(stage.jittered())

    found = [
        Scenario("250 Hz", "three pushes, sampled every 4 ms", _one(every, SLOW)),
        Scenario("jitter", "three pushes, sampled every 0.5 to 1.5 ms", _one(jittered)),
    ]
    for sigma in ENCODERS:
        says = (
            f"three pushes, positions with {sigma:g} rad of noise, velocities estimated from them"
        )
        found.append(Scenario(f"encoder, {sigma:g} rad", says, _one(stage.encoder, sigma)))
    return found
