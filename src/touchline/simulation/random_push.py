# SPDX-License-Identifier: Apache-2.0
"""Many single pushes at random poses and places of an arm that stands still."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Profile, ScriptedContact, ScriptedForces
from touchline.simulation.control import JointSprings
from touchline.simulation.held_push import can_hold, held_push
from touchline.simulation.plant import Plant
from touchline.simulation.scene import Run, describe, make_plant
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup, read_setup
from touchline.simulation.simulator import Rates, run
from touchline.simulation.touchable import (
    SurfacePoint,
    TouchableSurface,
    push_direction,
    structure_links,
)
from touchline.simulation.truth import Simulated, Truth

PAUSE = 1.0  # s between two pushes of one log, over which no filter integrates
TRIES = 10_000


@dataclass(frozen=True)
class Timing:
    """When a push begins, how long it rises and falls, and is held, and when its log ends [s]."""

    before: float = 0.1
    rise: float = 0.02
    hold: float = 0.3
    after: float = 0.05

    @property
    def seconds(self) -> float:
        """Of one push altogether."""
        return self.before + 2 * self.rise + self.hold + self.after


def random_push_runs(
    robot: Robot,
    count: int = 100,
    force: float | tuple[float, float] = 20.0,
    timing: Timing | None = None,
    links: Sequence[str] | None = None,
    friction: float = 0.5,
    settings: Run | None = None,
) -> Iterator[Simulated]:
    """Single pushes, each a log of its own that begins at time 0.

    Poses are uniform over the joints' ranges, points uniform over the area of the links. A pair
    is drawn again unless the point can be reached from outside: outside all other links, 3 cm
    free along its outward normal, above the floor.

    Args:
        robot: with surfaces.
        count: of pushes.
        force: strength [N], or the range over which it is drawn uniformly.
        timing: of each push.
        links: that are pushed; default: the structure.
        friction: the force's direction is uniform over this friction cone.
        settings: rates, noise, seed; the default's physics are at 1 kHz, and as long as that is
            the log's rate too, this is several times faster.
    """
    settings = settings or Run(physics=1000.0)
    timing = timing or Timing()
    links = structure_links(robot) if links is None else tuple(links)
    setup, surface = read_setup(robot), TouchableSurface(robot)
    plant = make_plant(robot, settings)
    for number in range(count):
        rng = np.random.default_rng([settings.seed, 4, number])
        q, at, normal = _reachable(robot, setup, surface, links, rng)
        strength = rng.uniform(*force) if isinstance(force, tuple) else force
        push = strength * push_direction(normal, friction, rng)
        profile = Profile(timing.before, timing.hold, timing.rise, timing.rise)
        contact = ScriptedContact(at.link, at.point, push, profile)
        yield _one(plant, setup, q, contact, timing, settings, number)


def random_pushes(
    robot: Robot,
    count: int = 100,
    force: float | tuple[float, float] = 20.0,
    timing: Timing | None = None,
    links: Sequence[str] | None = None,
    friction: float = 0.5,
    settings: Run | None = None,
) -> Simulated:
    """The pushes of `random_push_runs` as one log, with pauses of 1 s in which the arm is moved."""
    runs = random_push_runs(robot, count, force, timing, links, friction, settings)
    return joined(list(runs), PAUSE)


def _reachable(
    robot: Robot,
    setup: Setup,
    surface: TouchableSurface,
    links: Sequence[str],
    rng: np.random.Generator,
) -> tuple[Array, SurfacePoint, Array]:
    """A pose (n,), a point that can be reached there, and its outward normal (3,) in world."""
    for _ in range(TRIES):
        q = rng.uniform(setup.lower, setup.upper)
        at = surface.draw(rng, links)
        poses = robot.T_world_links(q)
        T = poses[at.link]
        point, normal = T[:3, :3] @ at.point + T[:3, 3], T[:3, :3] @ at.normal
        if point[2] < surface.floor:
            continue
        surface.place(poses)
        if surface.reachable(point, normal):
            return q, at, normal
    raise InputError(f"robot {robot.name}: no point of {', '.join(links)} can be reached")


def _one(
    plant: Plant,
    setup: Setup,
    q: Array,
    contact: ScriptedContact,
    timing: Timing,
    settings: Run,
    number: int,
) -> Simulated:
    if settings.control is None and can_hold(plant, settings.rate):
        readings, truth = held_push(plant, setup, q, contact, timing.seconds)
    else:
        plant.reset(q, time=-1.0 / settings.rate)
        springs = JointSprings(q, setup.stiffness, setup.damping)
        rates, forces = Rates(settings.rate, settings.control), ScriptedForces([contact])
        readings, truth = run(plant, springs, [forces], timing.seconds, rates)
    rng = np.random.default_rng([settings.seed, 5, number])
    samples = sense(plant.robot, readings, settings.noise, rng)
    told = describe(plant.robot, settings) | {"scenario": "random_pushes", "push": number}
    return Simulated(samples, truth, told)


def joined(runs: Sequence[Simulated], pause: float) -> Simulated:
    """Logs of one robot, each with one contact, as one log with `pause` [s] between them.

    Raises:
        ValueError: there are none.
    """
    if not runs:
        raise ValueError("there are no runs to join")
    times, shift = [], 0.0
    for simulated in runs:
        times.append(simulated.samples.time + shift)
        shift = float(times[-1][-1]) + pause
    fields = ("q", "qd", "tau", "wrench")
    arrays: dict[str, Array] = {
        f: np.concatenate([getattr(r.samples, f) for r in runs]) for f in fields
    }
    samples = Samples(time=np.concatenate(times), row=0, **arrays)
    truths = [r.truth for r in runs]
    rows = {
        f: np.concatenate([getattr(t, f) for t in truths])
        for f in ("link", "point", "force", "moment", "wrench_mean", "link_mean")
    }
    told = {k: v for k, v in runs[0].metadata.items() if k != "push"} | {"count": len(runs)}
    return replace(runs[0], samples=samples, truth=Truth(truths[0].links, **rows), metadata=told)
