# SPDX-License-Identifier: Apache-2.0
"""The moving arm runs into a body, or the body into the arm, and a reactor is in the loop."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.reaction.reactor import Reactor
from touchline.reaction.state import State
from touchline.simulation.closed_loop import LiveSensors, ReactingController, Step
from touchline.simulation.control import Controller, Setpoint, Trajectory
from touchline.simulation.guiding import GuidingHand, HandMotion, led
from touchline.simulation.noise import SensorNoise
from touchline.simulation.obstacle import PAD_RADIUS, TOUCHES, Body, Obstacle
from touchline.simulation.readings import Readings
from touchline.simulation.scene import Run, impedance, make_plant
from touchline.simulation.setup import Setup, read_setup
from touchline.simulation.shapes import CollisionShapes
from touchline.simulation.simulator import Contacts, Rates, run
from touchline.simulation.touchable import TouchableSurface
from touchline.simulation.truth import Truth

HIT_TIME = 0.15  # s: the observer has settled by then
PUSH_ON = 0.15  # s that the robot's own motion goes on at full speed after that
SLOW_DOWN = 0.2  # s in which it then comes to rest
CLEAR_TIMES = np.linspace(0.0, HIT_TIME - 0.01, 11)  # s at which nothing may touch yet
SPEED_SHARE = 0.8  # of the joints' speed limits
TRIES = 5000


@dataclass(frozen=True)
class Encounter:
    """How arm and body meet.

    Attributes:
        q: (n,) pose in which they would meet [rad or m].
        qd: (n,) of the arm's own motion through it.
        link: that is struck, and `body`, what strikes it.
    """

    q: Array
    qd: Array
    link: str
    body: Body

    def trajectory(self) -> Trajectory:
        """Constant velocity through `q` at HIT_TIME, at rest PUSH_ON + SLOW_DOWN later."""

        def at(time: float) -> Setpoint:
            late = min(max(time - HIT_TIME - PUSH_ON, 0.0), SLOW_DOWN)
            braking = 0.0 < time - HIT_TIME - PUSH_ON < SLOW_DOWN
            way = min(time, HIT_TIME + PUSH_ON) - HIT_TIME + late - late**2 / (2 * SLOW_DOWN)
            rate = 1.0 - late / SLOW_DOWN
            qdd = -self.qd / SLOW_DOWN if braking else np.zeros_like(self.qd)
            return Setpoint(self.q + way * self.qd, rate * self.qd, qdd)

        return at


@dataclass(frozen=True)
class Outcome:
    """What happened.

    Attributes:
        encounter: that was simulated.
        readings: of ideal sensors.
        truth: the obstacle's forces in the first slots, that of a hand in the last.
        steps: of the loop.
        torque: (N, n) motor torques commanded [Nm or N].
    """

    encounter: Encounter
    readings: Readings
    truth: Truth
    steps: list[Step]
    torque: Array

    @property
    def force(self) -> Array:
        """Force (N, 3) of the body on the arm, of all links that it touches, in world [N]."""
        return self.truth.force[:, :TOUCHES].sum(axis=1)


class EncounterScene:
    """An arm, an obstacle, and all that is costly to make and can serve again.

    Args:
        robot: with surfaces.
        settings: rates, noise, errors of the model.
        links: that collide; default: all that have a shape.
    """

    def __init__(
        self, robot: Robot, settings: Run | None = None, links: Sequence[str] | None = None
    ) -> None:
        self.robot = robot
        self.settings = settings or Run(noise=SensorNoise(), control=1000.0)
        self.setup: Setup = read_setup(robot)
        self.surface = TouchableSurface(robot)
        self.skin = Skin(robot)
        self.obstacle = Obstacle()
        shapes = CollisionShapes(robot.mechanism)
        add_shapes = shapes.addition(links or self.surface.surfaces)

        def add(spec, bodies) -> None:
            add_shapes(spec, bodies)
            self.obstacle.add(spec, bodies)

        self.plant = make_plant(robot, self.settings, addition=add)

    def draw(
        self,
        links: Sequence[str],
        speed: float,
        rng: np.random.Generator,
        spring: float = 2.5e4,
        mass: float = 4.0,
        own_share: float = 1.0,
    ) -> Encounter:
        """A random encounter: pose, point of the links, straight into the surface.

        The arm moves the point as fast as it may; the rest of the speed is the body's.

        Args:
            links: one of which is struck.
            speed: at which the surfaces approach [m/s].
            rng: draws.
            spring: of the body [N/m].
            mass: of the body [kg]; inf: a wall, which does not move.
            own_share: of the speed, at most, that is the arm's.

        Raises:
            InputError: no such encounter was found.
        """
        for _ in range(TRIES):
            q = rng.uniform(self.setup.lower, self.setup.upper)
            at = self.surface.draw(rng, links)
            poses = self.robot.T_world_links(q)
            T = poses[at.link]
            point, normal = T[:3, :3] @ at.point + T[:3, 3], T[:3, :3] @ at.normal
            if point[2] < self.surface.floor + PAD_RADIUS:
                continue
            self.surface.place(poses)
            if not self.surface.reachable(point, normal, clearance=3 * PAD_RADIUS):
                continue
            qd, own = self._motion(q, at.link, point, normal, own_share * speed)
            if np.isinf(mass) and own < 0.99 * speed:
                continue
            if self._in_range(q, qd):
                body = Body(point, -normal, HIT_TIME, speed - own, spring, mass)
                encounter = Encounter(q, qd, at.link, body)
                if self._clear(encounter):
                    return encounter
        raise InputError(
            f"robot {self.robot.name}: no encounter with {', '.join(links)} at {speed:g} m/s"
        )

    def _motion(
        self, q: Array, link: str, point: Array, normal: Array, speed: float
    ) -> tuple[Array, float]:
        """Joint velocities (n,) that move the point along its normal, and how fast [m/s]."""
        still = np.zeros_like(q)
        state = State(self.robot, 0.0, q, still, still)
        lever = state.lever(link, point, normal)
        if np.linalg.norm(lever) < 0.02:
            return still, 0.0
        direction = np.asarray(np.linalg.solve(state.inertia, lever), float)
        direction = direction / (lever @ direction)
        most = float(np.min(SPEED_SHARE * self.setup.speed / np.maximum(np.abs(direction), 1e-9)))
        speed = min(speed, most)
        return speed * direction, speed

    def _in_range(self, q: Array, qd: Array) -> bool:
        ends = q - HIT_TIME * qd, q + (PUSH_ON + SLOW_DOWN / 2) * qd
        return all(bool(np.all((self.setup.lower < e) & (e < self.setup.upper))) for e in ends)

    def _clear(self, encounter: Encounter) -> bool:
        """Whether nothing is in the body's way before it strikes."""
        trajectory = encounter.trajectory()
        for time in CLEAR_TIMES.tolist():
            goal = trajectory(time)
            self.plant.reset(goal.q, goal.qd, time)
            self.obstacle.place(self.plant, encounter.body)
            self.plant.evaluate()
            if self.plant.data.ncon > 0:
                return False
        return True

    def play(
        self,
        encounter: Encounter,
        reactor: Reactor,
        seconds: float = 1.0,
        seed: int = 0,
        hand: tuple[str, Array] | None = None,
    ) -> Outcome:
        """Simulates an encounter from rest or in motion, with the reactor in the loop.

        Args:
            encounter: from `draw`.
            reactor: fresh or reset.
            seconds: duration.
            seed: of the sensors' noise.
            hand: the link that a person holds and where (3,), in its frame [m], to lead the arm,
                which then has no motion of its own; None: nobody does.
        """
        settings, plant = self.settings, self.plant
        trajectory = encounter.trajectory()
        begin = -1.0 / settings.rate
        goal = trajectory(begin)
        plant.reset(goal.q, goal.qd, begin)
        self.obstacle.place(plant, encounter.body)
        count = 1 + round(seconds * settings.rate)
        rng = np.random.default_rng([settings.seed, 6, seed])
        sensors = LiveSensors(plant, count, settings.rate, settings.noise, rng)
        pipeline = Pipeline(self.robot, period=1.0 / settings.rate, skin=self.skin)
        rates = Rates(settings.rate, settings.control or settings.rate)
        own: Controller = impedance(self.setup, trajectory, rates.control)
        contacts: list[Contacts] = [self.obstacle]
        if hand is not None:
            own = led(self.setup, encounter.q)
            times = np.arange(round(seconds * settings.physics) + 1) / settings.physics
            motion = HandMotion.draw(rng, seconds)
            contacts.append(GuidingHand(*hand, motion, times, rng))
        controller = ReactingController(self.robot, own, pipeline, reactor, sensors)
        readings, truth = run(plant, controller, contacts, seconds, rates, controller.sampled)
        torque = np.array([step.command.torque for step in controller.steps])
        return Outcome(encounter, readings, truth, controller.steps, torque)
