# SPDX-License-Identifier: Apache-2.0
"""`sim://`: a simulated arm that stands, is touched, and then moves and is touched."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from touchline.errors import InputError
from touchline.live.pace import Pace, take_due
from touchline.live.sample import Sample, stamp
from touchline.live.source import Address
from touchline.live.streams import Stream
from touchline.model.robot import Robot
from touchline.simulation.control import Setpoint, Trajectory
from touchline.simulation.hands import Hand, Hands, place
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.scene import impedance, wandering
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup, read_setup
from touchline.simulation.simulator import Rates, Simulation
from touchline.simulation.touchable import TouchableSurface, structure_links, touchable_links

PHYSICS, RATE = 2000.0, 1000.0  # Hz
BLOCK = 10  # samples that are simulated at a time: the same numbers at any speed
FIRST, EVERY, LASTS = 2.0, 3.0, 1.5  # s: of the touches
MOVES, EASE = 8.0, 2.0  # s: from when on it moves, and how long it takes to begin
SOFT = 0.2  # of the robot's own stiffness: at all of it 1 kHz is too slow
TRIES = 200


class SimulatedArm:
    """The robot itself, simulated.

    Args:
        address: `sim://?seed=&speed=&motion=&force=`; speed 1 is real time, 0 as fast as possible;
            motion of the fastest joint [rad/s], force of each touch [N].
        robot: with surfaces.

    Raises:
        InputError: an option, or a robot that cannot be simulated.
    """

    def __init__(self, address: Address, robot: Robot) -> None:
        address.only("seed", "speed", "motion", "force")
        if address.place:
            raise InputError(f"{address.text}: expected sim:// and perhaps ?seed=1")
        self.name, self._robot = address.text, robot
        self._seed = int(address.number("seed", 1.0))
        self._speed = address.number("speed", 1.0)
        self._motion = address.number("motion", 0.4)
        self._force = address.number("force", 20.0)
        self.period: float | None = 1.0 / RATE
        self.streams = (Stream("simulation", self.period if self._speed == 1.0 else None),)

    def open(self) -> list[str]:
        """Starts the simulation."""
        self._pace = Pace(self._samples(), self._speed)
        return []

    def read(self, timeout: float) -> list[Sample]:
        """The samples that are due."""
        return take_due(self._pace, self.streams[0], timeout)

    def close(self) -> None:
        """There is nothing to end."""

    def _samples(self) -> Iterator[Sample]:
        rng = np.random.default_rng([self._seed, 1])
        setup = read_setup(self._robot)
        moving = wandering(setup, max(self._motion, 1e-6), rng, reach=0.5)
        trajectory = _Begun(setup.home, moving)
        plant = Plant(self._robot, PHYSICS)
        plant.reset(setup.home)
        plant.evaluate()
        hands = Hands()
        controller = impedance(_softer(setup), trajectory)
        simulation = Simulation(plant, controller, [hands], Rates(RATE, RATE))
        touches = _Touches(self._robot, hands, self._force, self._seed)
        noise, number = SensorNoise(), 0
        ages = np.zeros(len(self._robot.sensor_names))
        while True:
            touches.advance(number, plant)
            readings, _ = simulation.advance(BLOCK)
            found = sense(self._robot, readings, noise, rng)
            for i in range(BLOCK):
                signals = (found.q[i], found.qd[i], found.tau[i], found.wrench[i])
                at = stamp(round(number * 1e9 / RATE))
                yield Sample(at, *signals, sequence=number, ages=ages)
                number += 1


def _softer(setup: Setup) -> Setup:
    """Stiffness at which the controller is stable at its rate; damped as well as before."""
    if setup.stiffness is None or setup.damping is None:
        return setup
    return replace(setup, stiffness=SOFT * setup.stiffness, damping=np.sqrt(SOFT) * setup.damping)


class _Begun:
    """A trajectory that stands at a pose and then goes over into a motion about it."""

    def __init__(self, pose: np.ndarray, moving: Trajectory) -> None:
        self._pose, self._moving = pose, moving

    def __call__(self, at: float) -> Setpoint:
        x = min(max((at - MOVES) / EASE, 0.0), 1.0)
        s = x**3 * (10 - 15 * x + 6 * x**2)
        ds = 30 * x**2 * (1 - x) ** 2 / EASE
        dds = 60 * x * (1 - x) * (1 - 2 * x) / EASE**2
        goal = self._moving(at)
        away = goal.q - self._pose
        return Setpoint(
            self._pose + s * away,
            s * goal.qd + ds * away,
            s * goal.qdd + 2 * ds * goal.qd + dds * away,
        )


class _Touches:
    """Pushes at random places, one after the other."""

    def __init__(self, robot: Robot, hands: Hands, force: float, seed: int) -> None:
        self._robot, self._hands, self._force = robot, hands, force
        self._rng = np.random.default_rng([seed, 2])
        self._surface = TouchableSurface(robot)
        self._groups = [structure_links(robot), *touchable_links(robot).values()]

    def advance(self, number: int, plant: Plant) -> None:
        """Begins and ends pushes at the sample of that number."""
        since = number - round(FIRST * RATE)
        if since < 0 or self._force == 0.0:
            return
        phase = since % round(EVERY * RATE)
        if phase < BLOCK:
            self._push(plant)
        elif abs(phase - round(LASTS * RATE)) < BLOCK / 2:
            self._hands.release_all()

    def _push(self, plant: Plant) -> None:
        poses = self._robot.T_world_links(plant.q)
        self._surface.place(poses)
        links = self._groups[self._rng.integers(len(self._groups))]
        for _ in range(TRIES):
            at = self._surface.draw(self._rng, links)
            T = poses[at.link]
            point, normal = place(T, at.point), T[:3, :3] @ at.normal
            if self._surface.reachable(point, normal):
                T = plant.link_pose(at.link)
                R = T[:3, :3]
                grip = R.T @ (point - T[:3, 3])
                self._hands.add(Hand(at.link, grip, -self._force * (R.T @ normal)))
                return
