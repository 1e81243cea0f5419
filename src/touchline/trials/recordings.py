# SPDX-License-Identifier: Apache-2.0
"""Healthy recordings: an arm that moves, and is pushed once or every few seconds."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.model.description import SensorDescription
from touchline.model.robot import Robot, load_robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run
from touchline.simulation.touchable import SurfacePoint, TouchableSurface, structure_links
from touchline.simulation.truth import Simulated
from touchline.trials.free_motion import MotionMaker, generator, imperfect, random_trajectory
from touchline.trials.moving import carried
from touchline.trials.touches import TouchSampler

ROBOTS = ("sara", "sara-full", "ur5", "panda")
SECONDS, SPEED, FORCE, MODEL_ERROR = 2.4, 0.5, 25.0, 0.02  # s, rad/s, N
PUSHED, RELEASED = 0.9, 1.4  # s
PHASES = {"free": 0.6, "onset": PUSHED, "contact": 1.15, "release": RELEASED}  # s: a fault begins
DRAWS = 1000  # points that are tried
OUTBOARD = 4  # so many of the outermost links are pushed: all layouts feel these
EVERY = 3.0  # s from push to push, where there are many
MANY_OUTBOARD = 6  # so many links are pushed then
RATE = 1000.0  # Hz, of recordings without an engine
LASTS, FORCES, RISES = (0.2, 1.2), (8.0, 40.0), (0.005, 0.08)  # s, N, s: of the many


@dataclass(frozen=True)
class Recording:
    """A healthy recording.

    Attributes:
        robot: of it.
        seed: of all that is random.
        samples: of its sensors.
        body: that is pushed.
    """

    robot: Robot
    seed: int
    samples: Samples
    body: str


def robot_named(name: str) -> Robot:
    """An arm of ROBOTS; "ur5" has a base and a wrist sensor and six joint torques.

    Raises:
        InputError: the package example-robot-data is missing.
    """
    robot = load_robot(name)
    if name != "ur5":
        return robot
    places = (("base", "shoulder_link"), ("wrist", "wrist_3_link"))
    sensors = tuple(SensorDescription(sensor, link) for sensor, link in places)
    noise = replace(
        robot.description.noise,
        sensors={s.name: (0.05, 0.05, 0.05, 0.01, 0.01, 0.01) for s in sensors},
    )
    joints = tuple(replace(joint, torque="sensor") for joint in robot.description.joints)
    description = replace(
        robot.description,
        sensors=sensors,
        noise=noise,
        bandwidth_sensors={s.name: 100.0 for s in sensors},
        joints=joints,
    )
    return Robot(description, robot.mechanism)


def robots() -> list[tuple[str, Robot]]:
    """Those of ROBOTS whose models are installed."""
    found = []
    for name in ROBOTS:
        try:
            found.append((name, robot_named(name)))
        except InputError as error:
            print(f"{name}: left out, {error}")
    return found


def record(robot: Robot, seed: int, pushed: bool = True, seconds: float = SECONDS) -> Recording:
    """The arm swings; one of its outer links is pushed for half a second."""
    rng = np.random.default_rng([seed, 11])
    settings = Run(seed=seed, noise=SensorNoise(), model_error=MODEL_ERROR, physics=2000.0)
    free = scripted(robot, [], seconds, SPEED, settings).samples
    at = _reachable(robot, free, (PUSHED, RELEASED), OUTBOARD, rng)
    profile = Profile(PUSHED, RELEASED - PUSHED - 0.04, 0.02, 0.02)
    push = ScriptedContact(at.link, at.point, -FORCE * at.normal, profile, force_frame="link")
    samples = scripted(robot, [push], seconds, SPEED, settings).samples if pushed else free
    body = next(body.name for body in robot.bodies if at.link in body.links)
    return Recording(robot, seed, samples, body)


def record_pushes(robot: Robot, seed: int, seconds: float) -> tuple[Samples, int]:
    """The arm swings and is pushed every few seconds.

    Returns the samples, and how many pushes there are.
    """
    settings = Run(seed=seed, noise=SensorNoise(), model_error=MODEL_ERROR, physics=2000.0)
    simulated, pushes = push_often(robot, settings, seconds)
    return simulated.samples, len(pushes)


def push_often(
    robot: Robot, settings: Run, seconds: float
) -> tuple[Simulated, list[ScriptedContact]]:
    """The arm swings and is pushed every few seconds, by forces, times and rises at random.

    Args:
        robot: as told.
        settings: its seed is that of all that is random.
        seconds: duration.
    """
    rng = np.random.default_rng([settings.seed, 12])
    free = scripted(robot, [], seconds, SPEED, settings).samples
    pushes = []
    for profile, force in _strengths(seconds, rng):
        at = _reachable(robot, free, (profile.start, profile.end), MANY_OUTBOARD, rng)
        push = ScriptedContact(at.link, at.point, -force * at.normal, profile, force_frame="link")
        pushes.append(push)
    return scripted(robot, pushes, seconds, SPEED, settings), pushes


def prescribed_pushes(
    robot: Robot, seed: int, seconds: float, fastest: float = SPEED
) -> tuple[Samples, int]:
    """The same of an arm that follows its path whatever pushes it: quick, as no engine is needed.

    Args:
        robot: as told.
        seed: of the arm's inertias, its path, its pushes and its noise.
        seconds: duration.
        fastest: that its joints turn at [rad/s], see `random_trajectory`.

    Returns:
        Samples, and how many pushes there are.
    """
    rng = generator(seed, 13)
    maker = MotionMaker(robot, imperfect(robot, MODEL_ERROR, seed), RATE, seconds)
    path = random_trajectory(robot, rng, fastest)
    q, qd, loads = maker.loads(path)
    coarse = path(maker.coarse)[0]
    links = structure_links(robot)[-MANY_OUTBOARD:]
    sampler = TouchSampler(Skin(robot), np.random.default_rng(seed), floor=-np.inf, links=links)
    pushes = 0
    for profile, force in _strengths(seconds, rng):
        rows, near = maker.around(profile.start, profile.end)
        touch = sampler.sample(force, q[rows.start])
        points, forces = carried(robot, touch, coarse[near])
        push = np.hstack([forces, np.cross(points, forces)])
        felt = contact_loads(robot, coarse[near], touch.patch.link, push)
        held = np.hstack([felt.torque, felt.wrench.reshape(len(points), -1)])
        strength = np.array([profile.at(time) for time in maker.time[rows]])
        loads[rows] -= strength[:, None] * maker.interpolated(held, slice(0, len(strength)))
        pushes += 1
    samples = maker.sensed(q, qd, loads, rng)
    samples.q[:] = SensorNoise().quantized(robot, samples.q)
    return samples, pushes


def _strengths(seconds: float, rng: np.random.Generator) -> Iterator[tuple[Profile, float]]:
    """Times of pushes, one after the other, and their forces [N]."""
    for begin in np.arange(1.0, seconds - LASTS[1] - 0.1, EVERY):
        lasts, force, rise = (rng.uniform(*span) for span in (LASTS, FORCES, RISES))
        yield Profile(float(begin), max(0.0, lasts - 2 * rise), rise, rise), force


def _reachable(
    robot: Robot, free: Samples, span: tuple[float, float], links: int, rng: np.random.Generator
) -> SurfacePoint:
    """A point of the outermost links that a finger reaches all the time from here to there [s]."""
    surface = TouchableSurface(robot)
    postures = free.q[(free.time >= span[0]) & (free.time <= span[1])]
    poses = [robot.T_world_links(q) for q in postures[:: max(1, len(free) // 25)]]
    for _ in range(DRAWS):
        at = surface.draw(rng, structure_links(robot)[-links:])
        for T in poses:
            surface.place(T)
            R, p = T[at.link][:3, :3], T[at.link][:3, 3]
            if not surface.reachable(R @ at.point + p, R @ at.normal):
                break
        else:
            return at
    raise InputError(f"robot {robot.name}: no reachable point in {DRAWS} on its outer links")
