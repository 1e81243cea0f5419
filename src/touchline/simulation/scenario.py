# SPDX-License-Identifier: Apache-2.0
"""Scenarios: functions that return a simulated log with its truth.

All take the robot first and share the settings of `Run`; the same seed gives the same numbers.
"""

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.model.robot import Robot
from touchline.simulation.contacts import Profile, ScriptedContact, ScriptedForces
from touchline.simulation.control import hold
from touchline.simulation.places import Place, PlaceFinder
from touchline.simulation.pushers import CollidingPushers, Pusher
from touchline.simulation.random_push import random_pushes
from touchline.simulation.scene import Run, Tracking, impedance, simulate, wandering
from touchline.simulation.setup import read_setup
from touchline.simulation.shapes import CollisionShapes
from touchline.simulation.touchable import structure, structure_links, touchable_links
from touchline.simulation.truth import Simulated

PUSHER_TRIES = 100
ROUGHNESS, ROUGH_WITHIN = 5e-4, 0.012  # m by which colliding shapes may stand off, how far around


def free_motion(
    robot: Robot, seconds: float = 10.0, speed: float = 1.0, settings: Run | None = None
) -> Simulated:
    """The arm moves and nothing touches it.

    Args:
        robot: any.
        seconds: duration.
        speed: of the fastest joint [rad/s].
        settings: rates, noise, seed.
    """
    settings = settings or Run()
    controller = _motion(robot, speed, settings)
    return simulate(robot, controller, [], seconds, settings, scenario="free_motion")


def scripted(
    robot: Robot,
    contacts: Sequence[ScriptedContact],
    seconds: float,
    speed: float = 0.0,
    settings: Run | None = None,
    start: Array | None = None,
) -> Simulated:
    """Forces at given points of the arm.

    Args:
        robot: any.
        contacts: one slot of the truth each.
        seconds: duration.
        speed: of the fastest joint [rad/s]; 0: the arm stands.
        settings: rates, noise, seed.
        start: (n,) where the arm stands or about which it moves; default: home.
    """
    settings = settings or Run()
    controller = _motion(robot, speed, settings, start)
    forces = [ScriptedForces(contacts)]
    return simulate(robot, controller, forces, seconds, settings, scenario="scripted")


def three_touches(
    robot: Robot,
    speed: float = 0.0,
    force: float = 20.0,
    seconds: float = 1.0,
    settings: Run | None = None,
) -> Simulated:
    """Every segment is touched at the same time: structure, handle and end effector of `sara`.

    The forces are constant in world, pass through points fixed on the links, begin at 0.2 s and
    end 0.1 s before the log does.

    Args:
        robot: with surfaces.
        speed: of the fastest joint [rad/s]; 0: the arm stands.
        force: of each touch [N].
        seconds: duration.
        settings: rates, noise, seed.
    """
    groups = list(touchable_links(robot).values())
    return _touched(robot, groups, speed, force, seconds, settings, "three_touches")


def base_touch(
    robot: Robot,
    speed: float = 0.0,
    force: float = 20.0,
    seconds: float = 1.0,
    settings: Run | None = None,
) -> Simulated:
    """The innermost link of the structure is touched, which no joint torque can show.

    Arguments as in `three_touches`.
    """
    innermost = [structure_links(robot)[:1]]
    return _touched(robot, innermost, speed, force, seconds, settings, "base_touch")


def singular_push(
    robot: Robot, force: float = 20.0, seconds: float = 1.0, settings: Run | None = None
) -> Simulated:
    """The stretched arm is pushed in a direction in which it cannot move: no joint feels it.

    Arguments as in `three_touches`.

    Raises:
        InputError: no surface of the structure can be pushed in such a direction.
    """
    settings = settings or Run()
    setup = read_setup(robot)
    trajectory = hold(setup.stretched)
    links = structure_links(robot)
    finder = PlaceFinder(robot, trajectory, np.random.default_rng([settings.seed, 3]))
    place, lever = finder.find_weakest(links[len(links) // 2 :])
    contacts = [ScriptedForces([_contact(place, force, 0.2, seconds - 0.1)])]
    controller = impedance(setup, trajectory)
    told = {"scenario": "singular_push", "torque_per_newton": lever}
    return simulate(robot, controller, contacts, seconds, settings, **told)


def colliding_pushers(
    robot: Robot,
    speed: float = 0.0,
    force: float = 20.0,
    hold_time: float = 0.5,
    settings: Run | None = None,
) -> Simulated:
    """A ball is pressed against each segment, one after the other and then together.

    The truth are MuJoCo's own contact forces, friction included.

    Args:
        robot: with surfaces.
        speed: of the fastest joint [rad/s], which moves by some mm; 0: the arm stands.
        force: of each ball's spring [N].
        hold_time: with full force [s].
        settings: rates, noise, seed.
    """
    settings = settings or Run()
    setup = read_setup(robot)
    trajectory = hold(setup.home)
    if speed:
        trajectory = wandering(setup, speed, np.random.default_rng(settings.seed), reach=0.008)
    shapes = CollisionShapes(robot.mechanism)
    finder = PlaceFinder(robot, trajectory, np.random.default_rng([settings.seed, 3]))
    pushers = _pushers(robot, finder, shapes, force, hold_time)
    balls = CollidingPushers(pushers)
    add_shapes = shapes.addition(pusher.link for pusher in pushers)

    def add(spec: Any, bodies: dict[str, Any]) -> None:
        add_shapes(spec, bodies)
        balls.add(spec, bodies)

    controller = impedance(setup, trajectory)
    seconds = max(pusher.start + pusher.duration for pusher in pushers) + 0.2
    told = {"scenario": "colliding_pushers", "pushers": [pusher.name for pusher in pushers]}
    return simulate(robot, controller, [balls], seconds, settings, addition=add, **told)


def demo(robot: Robot, seconds: float = 20.0, settings: Run | None = None) -> Simulated:
    """The arm moves slowly, is touched near its base, then at three places at once, and again.

    Args:
        robot: with surfaces.
        seconds: duration.
        settings: rates, noise, seed.
    """
    settings = settings or Run()
    setup = read_setup(robot)
    trajectory = wandering(setup, 0.35, np.random.default_rng(settings.seed))
    finder = PlaceFinder(robot, trajectory, np.random.default_rng([settings.seed, 3]))
    links = structure_links(robot)
    ends = [group for name, group in touchable_links(robot).items() if name != structure(robot)]
    acts = [(links[:1], 0.5), (links[3:6], 3.0), *((e, 3.0) for e in ends), (links[1:3], 6.0)]
    contacts = []
    for begin in np.arange(0.5, seconds - 2.0, 8.0):
        for group, offset in acts:
            start = float(begin + offset)
            if start + 1.5 < seconds:
                place = finder.find(group, start, start + 1.5)
                force = finder.rng.uniform(10.0, 30.0)
                contacts.append(_contact(place, force, start, start + 1.5))
    controller = impedance(setup, trajectory)
    forces = [ScriptedForces(contacts)]
    return simulate(robot, controller, forces, seconds, settings, scenario="demo")


def _motion(robot: Robot, speed: float, settings: Run, start: Array | None = None) -> Tracking:
    setup = read_setup(robot)
    trajectory = hold(setup.home if start is None else start)
    if speed:
        rng = np.random.default_rng(settings.seed)
        trajectory = wandering(setup, speed, rng, center=start)
    return impedance(setup, trajectory)


def _touched(
    robot: Robot,
    groups: Sequence[Sequence[str]],
    speed: float,
    force: float,
    seconds: float,
    settings: Run | None,
    name: str,
) -> Simulated:
    """One scripted touch on each group of links, all at the same time."""
    settings = settings or Run()
    controller = _motion(robot, speed, settings)
    rng = np.random.default_rng([settings.seed, 3])
    finder = PlaceFinder(robot, controller.trajectory, rng)
    begin, end = 0.2, seconds - 0.1
    contacts = [_contact(finder.find(group, begin, end), force, begin, end) for group in groups]
    forces = [ScriptedForces(contacts)]
    return simulate(robot, controller, forces, seconds, settings, scenario=name)


def _contact(place: Place, force: float, begin: float, end: float) -> ScriptedContact:
    """A touch that is there from `begin` to `end` [s], with flanks of 50 ms."""
    profile = Profile(begin, hold=max(end - begin - 0.1, 0.0))
    return ScriptedContact(place.link, place.at.point, force * place.direction, profile)


def _pushers(
    robot: Robot, finder: PlaceFinder, shapes: CollisionShapes, force: float, hold_time: float
) -> list[Pusher]:
    """One ball for each segment, setting out one after the other."""
    groups = touchable_links(robot) | {structure(robot): structure_links(robot)[2:]}
    pushers = []
    for i, (segment, links) in enumerate(groups.items()):
        place = _true_place(robot, finder, shapes, links)
        T = finder.poses(0.0)[place.link]
        point = T[:3, :3] @ place.at.point + T[:3, 3]
        start = 0.1 + 0.3 * i
        pushers.append(Pusher(segment, place.link, point, place.direction, start, hold_time, force))
    return pushers


def _true_place(
    robot: Robot, finder: PlaceFinder, shapes: CollisionShapes, links: Sequence[str]
) -> Place:
    """A place where the shapes that collide do not stand off the true surface.

    Raises:
        InputError: there is none.
    """
    for _ in range(PUSHER_TRIES):
        place = finder.find(links, 0.0, 0.0, clearance=0.06)
        if shapes.depth(place.link, place.at.point, ROUGH_WITHIN) < ROUGHNESS:
            return place
    raise InputError(f"robot {robot.name}: the shapes of {', '.join(links)} are too rough")


SCENARIOS: dict[str, Callable[..., Simulated]] = {
    "free_motion": free_motion,
    "three_touches": three_touches,
    "base_touch": base_touch,
    "singular_push": singular_push,
    "colliding_pushers": colliding_pushers,
    "random_pushes": random_pushes,
    "demo": demo,
}
