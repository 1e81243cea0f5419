# SPDX-License-Identifier: Apache-2.0
"""The arm of the live page: simulated by MuJoCo, held by impedance control, pushed by visitors."""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import mass_matrix
from touchline.observer.samples import Samples
from touchline.result.contact import Contact
from touchline.simulation.control import JointImpedance, Trajectory
from touchline.simulation.hands import Hand, Hands, place
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.scene import wandering
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup, read_setup
from touchline.simulation.simulator import Rates, Simulation
from touchline.simulation.touchable import TouchableSurface, structure_links, touchable_links
from touchline.simulation.truth import Truth
from touchline.view.faults import SensorFault
from touchline.view.motion import Switched
from touchline.view.reach import pressed
from touchline.view.reacting import ReactingImpedance

PHYSICS, RATE = 2000.0, 1000.0  # Hz
SPEED = 0.4  # rad/s of the fastest joint
PULL_LENGTH = 0.15  # m at which a pull reaches its limit
DEEPEST = 0.08  # m below the surface, where a pull takes hold
TRIES = 200
FREQUENCY = 20.0  # rad/s of an arm that is held without gains of its own
LEAST_INERTIA = 1e-3  # kg m2


@dataclass
class Conditions:
    """What a visitor sets.

    Attributes:
        moving: whether the arm moves or stands.
        stiffness: share of the robot's usual stiffness.
        noise: whether the sensors are noisy.
        fault: of the sensors, one of `faults.FAULTS`.
        payload: mass at the tool that the model does not know [kg].
        reaction: to contacts, one of `contact.reaction.REACTIONS`.
    """

    moving: bool = False
    stiffness: float = 0.2
    noise: bool = True
    fault: str = "none"
    payload: float = 0.0
    reaction: str = "ignore"


def gains(robot: Robot, setup: Setup) -> tuple[Array, Array]:
    """Stiffness (n,) [Nm/rad] and damping (n,) [Nm s/rad] of the arm's impedance.

    Where none are given, each joint swings at FREQUENCY with the inertia that it moves, damped
    just enough not to overshoot.
    """
    if setup.stiffness is not None and setup.damping is not None:
        return setup.stiffness, setup.damping
    inertia = np.maximum(np.diag(mass_matrix(robot, setup.home)[0]), LEAST_INERTIA)
    return FREQUENCY**2 * inertia, 2.0 * FREQUENCY * inertia


class LiveArm:
    """Simulates the arm and its sensors part by part.

    Args:
        robot: with a torque signal for every joint; its name decides the gains.
        skin: its surfaces.
        seed: of the motion, the noise and random pushes.
        moving: how it moves; default: about its home.
    """

    def __init__(
        self, robot: Robot, skin: Skin, seed: int = 1, moving: Trajectory | None = None
    ) -> None:
        self.robot, self.skin = robot, skin
        self.hands = Hands()
        self._rng = np.random.default_rng(seed)
        self._setup = read_setup(robot)
        self._gains = gains(robot, self._setup)
        self._outermost = "tool" if "tool" in robot.places else robot.bodies[-1].links[0]
        moving = moving or wandering(self._setup, SPEED, self._rng, reach=0.5)
        self._trajectory = Switched(self._setup.home, moving)
        self._plant = Plant(robot, PHYSICS)
        self._plant.reset(self._setup.home)
        self._plant.evaluate()
        self._controller = ReactingImpedance(robot, self._impedance(1.0), self._trajectory)
        self._simulation = Simulation(
            self._plant, self._controller, [self.hands], Rates(RATE, RATE)
        )
        self._surface = TouchableSurface(robot)
        self._conditions: Conditions | None = None
        self._noise: SensorNoise | None = None
        self.set(Conditions())

    def _impedance(self, share: float) -> JointImpedance:
        stiffness, damping = self._gains
        return JointImpedance(self._trajectory, share * stiffness, np.sqrt(share) * damping, RATE)

    @property
    def time(self) -> float:
        """Of the simulation [s]."""
        return self._plant.time

    @property
    def q(self) -> Array:
        """Joint positions (n,) [rad]."""
        return self._plant.q

    @property
    def reacting(self) -> str | None:
        """The reaction that has taken over from the arm's own controller."""
        return self._controller.active

    def lead(self, step: Array) -> None:
        """Moves the pose at which it stands by (n,) [rad or m]."""
        self._trajectory.lead(step)

    def feel(self, contacts: list[Contact], tau_ext: Array) -> None:
        """Tells the arm what it feels, for it to react: `tau_ext` (n,) [Nm], NaN if not known."""
        self._controller.contacts, self._controller.tau_ext = contacts, tau_ext

    def set(self, conditions: Conditions) -> None:
        """Takes on what a visitor has set."""
        before, self._conditions = self._conditions, conditions
        self._trajectory.wanted = conditions.moving
        self._controller.impedance = self._impedance(conditions.stiffness)
        self._controller.reaction = conditions.reaction
        self._noise = SensorNoise() if conditions.noise else None
        if before is None or before.payload != conditions.payload:
            self._plant.load(self._outermost, conditions.payload)
        if before is None or before.fault != conditions.fault:
            self._fault = SensorFault(self.robot, conditions.fault, self._rng)

    def advance(self, rows: int) -> tuple[Samples, Truth]:
        """What the sensors log in the next `rows` samples, and what touches the arm."""
        for hand in self.hands.active():
            self._press(hand)
        readings, truth = self._simulation.advance(rows)
        samples = sense(self.robot, readings, self._noise, self._rng)
        return self._fault.apply(samples), truth

    def press(self, origin: Array, direction: Array, force: float) -> Hand | None:
        """A push straight into the surface where a ray meets the arm, if it does.

        Args:
            origin: (3,) of the ray in world [m].
            direction: (3,) of the ray.
            force: [N].
        """
        for crossing in self.skin.crossings(self.q, origin, direction):
            if crossing.entry and crossing.distance > 0:
                return self._push(crossing.link, crossing.position, crossing.normal, force)
        return None

    def _push(self, link: str, point: Array, normal: Array, force: float) -> Hand:
        T = self._plant.link_pose(link)
        R = T[:3, :3]
        hand = Hand(link, R.T @ (point - T[:3, 3]), -force * (R.T @ normal))
        self.hands.add(hand)
        return hand

    def push_anywhere(self, force: float) -> Hand | None:
        """A push straight into the surface at a random place that a finger can reach."""
        poses = self.robot.T_world_links(self.q)
        self._surface.place(poses)
        groups = [structure_links(self.robot), *touchable_links(self.robot).values()]
        links = groups[self._rng.integers(len(groups))]
        for _ in range(TRIES):
            at = self._surface.draw(self._rng, links)
            T = poses[at.link]
            point, normal = place(T, at.point), T[:3, :3] @ at.normal
            if self._surface.reachable(point, normal):
                return self._push(at.link, point, normal, force)
        return None

    def pull(self, link: str, point: Array, eye: Array, force: float) -> Hand:
        """Takes hold of a link in its middle, behind a point of its surface as seen from `eye`.

        Along the surface no finger can pull; in the middle a pull in any direction is felt like
        a push from the other side.

        Args:
            link: that is taken hold of.
            point: (3,) in world [m] near its surface.
            eye: (3,) in world [m] from where it is seen.
            force: the largest [N].
        """
        grip = self._middle(link, point, eye)
        T = self._plant.link_pose(link)
        local = T[:3, :3].T @ (grip - T[:3, 3])
        hand = Hand(link, local, target=grip, stiffness=force / PULL_LENGTH, limit=force)
        self.hands.add(hand)
        return hand

    def _middle(self, link: str, point: Array, eye: Array) -> Array:
        ray = point - eye
        seen = float(np.linalg.norm(ray))
        through = [c for c in self.skin.crossings(self.q, eye, ray) if c.link == link]
        pairs = [
            (into.distance, out.distance)
            for into, out in zip(through[:-1], through[1:], strict=True)
            if into.entry and not out.entry
        ]
        if not pairs:
            return self.skin.nearest(self.q, link, point)[1]
        near, far = min(pairs, key=lambda pair: abs(pair[0] - seen))
        return eye + ray / seen * (near + min((far - near) / 2, DEEPEST))

    def grip(self, hand: Hand) -> Array:
        """Where a hand holds the arm (3,) in world [m]."""
        return place(self._plant.link_pose(hand.link), hand.grip)

    def springs(self) -> list[tuple[Array, Array]]:
        """Both ends (3,) in world [m] of each pull."""
        hands = self.hands.active()
        return [(self.grip(h), h.target) for h in hands if h.target is not None]

    def _press(self, hand: Hand) -> None:
        """Finds what a pull presses: the place where a push along its line would act."""
        size = float(np.linalg.norm(hand.acting))
        if hand.target is None or size < 0.1:
            return
        crossings = self.skin.crossings(self.q, self.grip(hand), hand.acting / size)
        hand.pressed, hand.behind = pressed(crossings, hand.link) or (hand.link, 0.0)
