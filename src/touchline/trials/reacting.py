# SPDX-License-Identifier: Apache-2.0
"""One encounter of the arm with a body, played with every reaction, and what is measured of it."""

from collections.abc import Iterator
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np

from touchline.arrays import Array
from touchline.model.description import PolicyDescription, PolicyRule
from touchline.model.robot import Robot, load_robot
from touchline.reaction.reaction import REACTIONS
from touchline.reaction.reactor import Reactor
from touchline.simulation.encounter import HIT_TIME, Encounter, EncounterScene, Outcome
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scene import Run
from touchline.trials.guiding import HANDLE, handle_point

SCENES = ("free", "wall", "guided")
LINKS = {
    "free": (*(f"link{i}" for i in range(8)), "tool", "handle"),
    "wall": (*(f"link{i}" for i in range(2, 8)), "tool", "handle"),
    "guided": ("link1", "link3", "link5", "link7"),
}
SPEEDS = {"free": (0.25, 0.5, 1.0, 1.5), "wall": (0.25, 0.5), "guided": (0.5, 1.0)}  # m/s
SPRINGS, MASSES = (5e3, 7.5e4), (1.0, 16.0)  # N/m, kg
SECONDS = 0.8
QUIET = 20.0  # N
MODEL_ERROR = 0.02


@dataclass(frozen=True)
class Case:
    """One encounter, to be played with each reaction.

    Attributes:
        scene: "free": the body gives way; "wall": it cannot; "guided": it gives way, and a person
            leads the arm by its handle.
        link: that is struck.
        speed: of approach [m/s].
        seed: of the encounter.
    """

    scene: str
    link: str
    speed: float
    seed: int


@dataclass(frozen=True)
class Trial:
    """A case with one reaction; times from the first touch, NaN where it never came.

    Attributes:
        scene, link, speed, seed: of the case.
        reaction: of the robot.
        spring, mass: of the body [N/m, kg].
        peak: largest contact force along the body's way [N]: what presses its spring.
        impulse: of that force [N s].
        quiet: time after which it stays below 20 N [s].
        way: of the struck point towards the body from the first touch on [m].
        reacted: time of the first reacting torque [s].
        effort: largest joint torque, as a part of its limit.
        clipped: whether a limit cut the reaction.
        false: whether it reacted before the touch, or first to the hand that leads.
    """

    scene: str
    link: str
    speed: float
    seed: int
    reaction: str
    spring: float
    mass: float
    peak: float
    impulse: float
    quiet: float
    way: float
    reacted: float
    effort: float
    clipped: bool
    false: bool


def cases(encounters: int) -> Iterator[Case]:
    """All cases, some encounters for each link and speed."""
    for seed in range(encounters):
        for scene in SCENES:
            yield from (Case(scene, link, v, seed) for link in LINKS[scene] for v in SPEEDS[scene])


@cache
def arm_scene() -> EncounterScene:
    """The arm with an obstacle; made once for each process."""
    settings = Run(noise=SensorNoise(), control=1000.0, model_error=MODEL_ERROR)
    return EncounterScene(load_robot("sara"), settings)


def encounter_of(case: Case) -> Encounter:
    """The encounter of a case; the same for every reaction."""
    key = [case.seed, SCENES.index(case.scene), LINKS["free"].index(case.link)]
    rng = np.random.default_rng([*key, round(1000 * case.speed)])
    spring, mass = (float(np.exp(rng.uniform(*np.log(span)))) for span in (SPRINGS, MASSES))
    mass = np.inf if case.scene == "wall" else mass
    own_share = 0.0 if case.scene == "guided" else 1.0
    return arm_scene().draw((case.link,), case.speed, rng, spring, mass, own_share)


def outcome_of(case: Case, encounter: Encounter, reaction: str) -> Outcome:
    """Simulates the case with one reaction."""
    scene = arm_scene()
    hand = (HANDLE, handle_point(scene.plant)) if case.scene == "guided" else None
    return scene.play(encounter, reactor(scene.robot, reaction), SECONDS, case.seed, hand)


def play(case: Case) -> list[Trial]:
    """The case with every reaction."""
    encounter = encounter_of(case)
    robot = arm_scene().robot
    return [measure(outcome_of(case, encounter, n), case, n, robot) for n in REACTIONS]


def reactor(robot: Robot, reaction: str) -> Reactor:
    """That answers every collision with one reaction."""
    return Reactor(robot, PolicyDescription(rules=[PolicyRule(reaction, level="collision")]))


def pressing(outcome: Outcome) -> Array:
    """Force (N,) of the body on the arm along the body's way [N]."""
    inwards = np.asarray(outcome.encounter.body.direction)
    return np.maximum(outcome.force @ inwards, 0.0)


def measure(outcome: Outcome, case: Case, reaction: str, robot: Robot) -> Trial:
    """The figures of one simulated encounter."""
    time = outcome.readings.time
    force = pressing(outcome)
    touched = np.flatnonzero(force > 0.0)
    begin = float(time[touched[0]]) if len(touched) else HIT_TIME
    acting = [step for step in outcome.steps if step.command.reaction != "ignore"]
    path = _point_path(outcome, robot, outcome.readings.q[time >= begin])
    way = (path - path[0]) @ -np.asarray(outcome.encounter.body.direction)
    efforts = np.array([robot.mechanism.joints[name].effort for name in robot.joint_names])
    answered = [step.command.contact for step in acting if step.command.contact is not None]
    wrong = case.link != HANDLE and bool(answered) and answered[0].segment == HANDLE
    return Trial(
        **asdict(case),
        reaction=reaction,
        spring=outcome.encounter.body.spring,
        mass=outcome.encounter.body.mass,
        peak=float(force.max()),
        impulse=float(force.sum() * (time[1] - time[0])),
        quiet=_quiet(time[force > QUIET], time, begin),
        way=float(way.max()),
        reacted=float(acting[0].time - begin) if acting else float("nan"),
        effort=float(np.max(np.abs(outcome.torque) / efforts)),
        clipped=any(step.command.clipped for step in acting),
        false=wrong or bool(acting and acting[0].time < begin),
    )


def _point_path(outcome: Outcome, robot: Robot, q: Array) -> Array:
    """Where the struck point of the link is (N, 3) [m]."""
    encounter = outcome.encounter
    T_then = robot.T_world_links(encounter.q)[encounter.link]
    local = np.linalg.inv(T_then) @ np.append(np.asarray(encounter.body.point), 1.0)
    return np.array([(robot.T_world_links(row)[encounter.link] @ local)[:3] for row in q])


def _quiet(loud: Array, time: Array, begin: float) -> float:
    if not len(loud):
        return 0.0
    return float("nan") if loud[-1] == time[-1] else float(loud[-1] - begin)
