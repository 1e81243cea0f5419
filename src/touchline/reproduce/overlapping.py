# SPDX-License-Identifier: Apache-2.0
"""The run of figure 5: two balls push a soft arm, overlapping in time, and are drawn back."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import load_robot
from touchline.reproduce.aim import place_along
from touchline.reproduce.replay import Replay
from touchline.simulation.control import JointImpedance, hold
from touchline.simulation.noise import SensorNoise
from touchline.simulation.places import PlaceFinder
from touchline.simulation.pushers import CollidingPushers, Pusher
from touchline.simulation.scene import Run, make_plant
from touchline.simulation.sensing import sense
from touchline.simulation.setup import read_setup
from touchline.simulation.shapes import CollisionShapes
from touchline.simulation.simulator import run as run_plant
from touchline.simulation.truth import Simulated

SECONDS = 4.5
CLEAR = 0.35  # how far a ball is drawn back, out of the way of the arm [m]
SOFTNESS, DAMPING = 0.15, 0.12  # of the arm, as parts of its usual gains


@dataclass(frozen=True)
class QuickRelease(Pusher):
    """A ball that is drawn back much faster than it comes.

    Attributes:
        retreat: speed of the spring's end on its way back [m/s].
    """

    retreat: float = 2.0

    @property
    def release(self) -> float:
        """When it is drawn back [s]."""
        return self.start + self._reach / self.speed + self.hold

    @property
    def duration(self) -> float:
        """From setting out until it is back [s]."""
        return self.release - self.start + self._reach / self.retreat

    def travel(self, time: float) -> float:
        """How far the spring's end has come [m]."""
        way = min(self.speed * (time - self.start), self._reach)
        if time > self.release:
            way = self._reach - self.retreat * (time - self.release)
        return float(np.clip(way, -CLEAR * (time > self.release), self._reach))


@dataclass(frozen=True)
class Pushes:
    """The run, as noisy sensors report it and as ideal ones would.

    Attributes:
        noisy: what everything but the ghosts is measured on.
        ideal: the same motion without noise, which would hide the ghosts.
    """

    noisy: Replay
    ideal: Replay


def pushed(seed: int = 0) -> Pushes:
    """Simulates the pushes and takes them through the pipeline."""
    robot = load_robot("sara")
    setup = read_setup(robot)
    finder = PlaceFinder(robot, hold(setup.home), np.random.default_rng([seed, 51]))
    poses = robot.T_world_links(setup.home)
    pushers = [
        _ball(finder, poses, "structure", "link4", start=0.3, force=120.0, hold_time=1.3),
        _ball(finder, poses, "hand", "tool", start=0.9, force=150.0, hold_time=1.5),
    ]
    balls = CollidingPushers(pushers)
    add_shapes = CollisionShapes(robot.mechanism).addition(pusher.link for pusher in pushers)

    def add(spec: Any, bodies: dict[str, Any]) -> None:
        add_shapes(spec, bodies)
        balls.add(spec, bodies)

    settings = Run(seed=seed)
    plant = make_plant(robot, settings, addition=add)
    plant.reset(setup.home, time=-1.0 / settings.rate)
    stiffness, damping = np.asarray(setup.stiffness), np.asarray(setup.damping)
    controller = JointImpedance(hold(setup.home), stiffness * SOFTNESS, damping * DAMPING)
    readings, truth = run_plant(plant, controller, [balls], SECONDS)
    rng = np.random.default_rng([seed, 52])
    noisy = Simulated(sense(robot, readings, SensorNoise(), rng), truth)
    ideal = Simulated(sense(robot, readings, None, rng), truth)
    return Pushes(Replay(robot, noisy), Replay(robot, ideal))


def _ball(
    finder: PlaceFinder,
    poses: dict[str, Array],
    name: str,
    link: str,
    start: float,
    force: float,
    hold_time: float,
) -> QuickRelease:
    """A ball that pushes a link sideways, to the left."""
    place = place_along(finder, (link,), (0.0, 1.0, 0.0), clearance=0.06, either_way=False)
    T = poses[link]
    point = T[:3, :3] @ place.at.point + T[:3, 3]
    spring = {"stiffness": 600.0, "speed": 0.4, "radius": 0.06}
    return QuickRelease(name, link, point, place.direction, start, hold_time, force, **spring)
