# SPDX-License-Identifier: Apache-2.0
"""What happens to the arm in the wrench benchmark: motions, pushes, impacts, faults."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property

import numpy as np

from touchline.arrays import Index
from touchline.bench.wrench.log import Log, Recording, record
from touchline.logs.velocity import choose_window, estimate_velocity
from touchline.model.mechanism import Inertia
from touchline.model.robot import Robot
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.control import Setpoint, Trajectory, sinusoids
from touchline.simulation.noise import SensorNoise
from touchline.simulation.places import PlaceFinder
from touchline.simulation.scene import wandering
from touchline.simulation.setup import read_setup

START = 0.5  # of each log, while filters settle [s]
QUIET = 1.5  # until then nothing touches a log with impacts [s]
SPEED = 1.0  # of the fastest joint of an arm that is touched [rad/s]
CALM = 8.0  # acceleration of the motion on which faults are shown [rad/s2]
PUSH, IMPACT = 20.0, 50.0  # [N]
PAYLOAD = 0.5  # [kg]
DISTURBANCE = 10.0  # amplitude [Nm]
BIAS = np.array([2.0, -1.5, 1.0, 0.10, 0.15, -0.05])  # of the wrist's sensor [N, Nm]
SET_OFF, RAMP = 0.9, 0.005  # when the arm sets off, and how long its acceleration grows [s]
REACH = 0.4  # largest amplitude of a swing [rad]
PAUSE, ROUNDS = 0.3, 2  # between impacts [s], impacts on each link
NOISE = SensorNoise()


class Stage:
    """Records the logs; the same seed gives the same numbers.

    Args:
        robot: with a torque sensor in every joint, without which the classical route is lost.
        seed: of motions, places and noise.
    """

    def __init__(self, robot: Robot, seed: int) -> None:
        self.robot, self.seed, self.setup = robot, seed, read_setup(robot)

    def rng(self, *purpose: int) -> np.random.Generator:
        """A source of chance of its own for each purpose."""
        return np.random.default_rng([self.seed, 71, *purpose])

    def free(self, acceleration: float, noise: SensorNoise | None = NOISE) -> Log:
        """Nothing touches; the log begins in the midst of the motion."""
        recording = record(self.robot, self.swing(acceleration), [], START + 2.5)
        return recording.log(noise, self.rng(2))

    def swing(self, acceleration: float) -> Trajectory:
        """Sines about home; the joints' largest accelerations lie between half and all of it."""
        rng, n = self.rng(1), len(self.robot.joint_names)
        share = rng.uniform(0.5, 1.0, n)
        share[rng.integers(n)] = 1.0
        speed = np.minimum(np.sqrt(REACH * acceleration * share), 0.85 * self.setup.speed)
        frequency = acceleration * share / speed
        return sinusoids(
            self.setup.home, speed / frequency, frequency, rng.uniform(0.0, 2 * np.pi, n)
        )

    def set_off(self, acceleration: float) -> Log:
        """The arm rests until `SET_OFF`, then all joints accelerate alike, with a short ramp."""
        sign = self.rng(3).choice([-1.0, 1.0], len(self.robot.joint_names))

        def at(time: float) -> Setpoint:
            ramp = min(max(time - SET_OFF, 0.0), RAMP)
            t = max(time - SET_OFF - RAMP, 0.0)
            a = ramp / RAMP
            v = ramp**2 / (2 * RAMP) + a * t
            x = ramp**3 / (6 * RAMP) + ramp**2 / (2 * RAMP) * t + a * t**2 / 2
            way = acceleration * sign
            return Setpoint(self.setup.home + x * way, v * way, a * way)

        return record(self.robot, at, [], SET_OFF + 0.12).log(NOISE, self.rng(4))

    def payload(self) -> Log:
        """The tool is heavier than the model says, by a point mass at its centre."""
        links = self.robot.mechanism.links
        body = links["tool"].inertia
        heavier = replace(
            links["tool"], inertia=Inertia(body.mass + PAYLOAD, body.com, body.inertia)
        )
        mechanism = replace(self.robot.mechanism, links={**links, "tool": heavier})
        recording = record(self.robot, self.swing(CALM), [], START + 2.0, mechanism)
        return recording.log(NOISE, self.rng(5))

    def disturbed(self) -> Log:
        """Joint 5 turns with a torque that its sensor misses, as in the paper's figure 4."""
        log = record(self.robot, self.swing(CALM), [], START + 2.0).log(NOISE, self.rng(17))
        tau = log.samples.tau.copy()
        tau[:, 4] -= DISTURBANCE * np.sin(2 * np.pi * log.time)
        return replace(log, samples=replace(log.samples, tau=tau))

    def biased(self) -> Log:
        """The wrist's sensor reads `BIAS` too much."""
        log = record(self.robot, self.swing(CALM), [], START + 2.0).log(NOISE, self.rng(6))
        wrench = log.samples.wrench.copy()
        wrench[:, self.robot.sensor_names.index("wrist")] += BIAS
        return replace(log, samples=replace(log.samples, wrench=wrench))

    def push(self, link: str) -> Log:
        """One push on a link of the moving arm."""
        number = list(self.robot.mechanism.links).index(link)
        contact = self._contact(link, PUSH, Profile(START + 0.1, hold=0.4), self.rng(7, number))
        return record(self.robot, self.wander, [contact], 1.3).log(NOISE, self.rng(8, number))

    @cached_property
    def wander(self) -> Trajectory:
        """The motion of an arm that is touched."""
        return wandering(self.setup, SPEED, self.rng(9))

    def _contact(
        self, link: str, force: float, profile: Profile, rng: np.random.Generator
    ) -> ScriptedContact:
        """A force at a point that can be reached, both carried along by the link."""
        middle = (profile.start + profile.end) / 2
        finder = PlaceFinder(self.robot, self.wander, rng)
        place = finder.find((link,), middle, middle)
        R = finder.poses(middle)[link][:3, :3]
        push = force * place.direction @ R
        return ScriptedContact(link, place.at.point, push, profile, force_frame="link")

    def impacts(self, duration: float, links: Sequence[str]) -> tuple[Log, list[tuple[str, float]]]:
        """Half sines of `IMPACT` on links in turn, and when each begins [s]."""
        rng = self.rng(10)
        contacts, onsets = [], []
        for i, link in enumerate(list(links) * ROUNDS):
            start = QUIET + PAUSE * i + rng.uniform(0.0, 1e-3)  # not on a sample
            profile = Profile(start, hold=duration, rise=0.0, fall=0.0, shape="half_sine")
            contacts.append(self._contact(link, IMPACT, profile, rng))
            onsets.append((link, start))
        recording = record(self.robot, self.wander, contacts, QUIET + PAUSE * len(contacts))
        return recording.log(NOISE, self.rng(11)), onsets

    @cached_property
    def three(self) -> Recording:
        """Structure, tool and handle are pushed, one after the other, then all at once."""
        spans = {"link4": (0.6, 2.1), "tool": (0.9, 1.9), "handle": (1.2, 1.7)}
        rng = self.rng(12)
        contacts = [
            self._contact(link, PUSH, Profile(begin, hold=end - begin), rng)
            for link, (begin, end) in spans.items()
        ]
        return record(self.robot, self.wander, contacts, 2.5)

    def three_pushes(self, rows: Index | None = None) -> Log:
        """`three`, sampled at rows of the recording; default: at 1 kHz."""
        return self.three.log(NOISE, self.rng(13), rows)

    def jittered(self) -> Index:
        """Rows about 1 ms apart: 0.5 to 1.5 ms."""
        rows = np.arange(4, len(self.three.readings.time) - 4, 4)
        return rows + self.rng(14).integers(-1, 2, len(rows))

    def encoder(self, sigma: float) -> Log:
        """`three` with noisy positions [rad] only, from which the velocities are estimated."""
        ideal = replace(NOISE, velocity=0.0, position_bits=0)
        log = self.three.log(ideal, self.rng(15))
        q = log.samples.q + sigma * self.rng(16).normal(size=log.samples.q.shape)
        noise = self.robot.description.noise
        n = q.shape[1]
        period = float(np.median(np.diff(log.time)))
        bandwidth = np.array(self.robot.description.bandwidth_joints)
        window = choose_window(np.full(n, sigma), np.array(noise.qd), bandwidth, period)
        qd = estimate_velocity(log.time, q, slice(0, len(q)), window)
        return replace(log, samples=replace(log.samples, q=q, qd=qd))
