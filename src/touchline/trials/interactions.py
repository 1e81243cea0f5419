# SPDX-License-Identifier: Apache-2.0
"""Simulated interactions whose kind is known: blows and holds, clamped and free, on every zone.

A collision is a blow of a mass that meets the arm through a spring: with the speed v,
F = v sqrt(k m) sin(sqrt(k/m) t); part of some stays, as against a wall. A contact rises smoothly,
is held with a tremor, and goes. Clamped ones have two such forces on two sides. The arm moves
steadily; its dynamics are exact but for inertias that are not those of the description.
"""

from dataclasses import dataclass

import numpy as np

from touchline.arrays import Array
from touchline.classifier.zones import Zones
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads, inverse_dynamics
from touchline.trials.touches import Signals, Touch, TouchSampler, add_noise

BEGIN, SECONDS = 0.3, 0.9  # s: of the interaction, of the recording
SPEEDS, SPRINGS, MASSES = (0.25, 1.5), (5e3, 7.5e4), (2.0, 6.0)  # m/s, N/m, kg of blows
FORCES = {"structure": (5.0, 60.0), "end_effector": (5.0, 60.0), "handle": (5.0, 80.0)}  # N held
RISES = {"structure": (0.15, 0.6), "end_effector": (0.15, 0.6), "handle": (0.08, 0.5)}  # s
TREMOR, TREMOR_RATE = 0.05, (6.0, 12.0)  # part of the force, Hz
ARM_SPEED = 0.5  # rad/s of every joint at most
MODEL_ERROR = 0.02
STAYS = 0.4  # share of the blows that leave a force
OPPOSED = -0.8  # cosine at most between the forces of a clamp
TRIES = 3000


@dataclass(frozen=True)
class Interaction:
    """What is done to the arm.

    Attributes:
        kind: "contact" or "collision".
        zone: that is touched first.
        clamped: whether two forces oppose each other.
        touches: one, or two on two sides, with unit forces.
        force: (N,) their strength over time [N].
        signals: of the sensors.
    """

    kind: str
    zone: str
    clamped: bool
    touches: tuple[Touch, ...]
    force: Array
    signals: Signals


class InteractionSampler:
    """Draws interactions.

    Args:
        robot: that is touched.
        sampler: of places on it.
        rng: source of chance.
        period: between samples [s].
    """

    def __init__(
        self, robot: Robot, sampler: TouchSampler, rng: np.random.Generator, period: float = 1e-3
    ) -> None:
        self._robot, self._sampler, self._rng = robot, sampler, rng
        self._zones = Zones(robot)
        self.time = np.arange(round(SECONDS / period)) * np.float64(period)

    def draw(self, kind: str, zone: str, clamped: bool) -> Interaction:
        """One interaction.

        Raises:
            RuntimeError: no place was found.
        """
        touches = self._touches(zone, clamped)
        force = self.blow() if kind == "collision" else self.hold(zone)
        signals = self.signals(touches, force)
        return Interaction(kind, zone, clamped, touches, force, signals)

    def blow(self) -> Array:
        """Strength (N,) of a blow [N]."""
        rng = self._rng
        v, m = rng.uniform(*SPEEDS), rng.uniform(*MASSES)
        k = np.exp(rng.uniform(*np.log(SPRINGS)))
        phase = np.sqrt(k / m) * np.maximum(self.time - BEGIN, 0.0)
        stays = rng.uniform(0.2, 0.7) if rng.random() < STAYS else 0.0
        pulse = np.where(phase < np.pi, np.sin(phase), 0.0)
        after = np.where(phase < np.pi / 2, np.sin(phase), 1.0)  # what stays from the peak on
        return v * np.sqrt(k * m) * np.maximum(pulse, stays * after)

    def hold(self, zone: str) -> Array:
        """Strength (N,) of a held contact [N]."""
        rng = self._rng
        rise, size = rng.uniform(*RISES[zone]), rng.uniform(*FORCES[zone])
        x = np.clip((self.time - BEGIN) / rise, 0.0, 1.0)
        shake = np.sin(2 * np.pi * rng.uniform(*TREMOR_RATE) * self.time + rng.uniform(0, 6.28))
        return size * (0.5 - 0.5 * np.cos(np.pi * x)) * (1.0 + TREMOR * shake)

    def _touches(self, zone: str, clamped: bool) -> tuple[Touch, ...]:
        for _ in range(TRIES):
            first = self._sampler.sample(1.0)
            if self._zones.of("", first.patch.link) != zone:
                continue
            if not clamped:
                return (first,)
            for _ in range(60):
                second = self._sampler.sample(1.0, q=first.q, taken=(first.patch.body,))
                if second.force @ first.force < OPPOSED:
                    return first, second
        raise RuntimeError(f"no place on {zone}")

    def signals(self, touches: tuple[Touch, ...], force: Array) -> Signals:
        """What the sensors report while the touches press with a strength (N,) [N]."""
        rng, robot = self._rng, self._robot
        real = Robot(robot.description, perturbed(robot.mechanism, MODEL_ERROR, rng))
        rate = rng.uniform(-ARM_SPEED, ARM_SPEED, len(robot.joint_names))
        q = touches[0].q + np.outer(self.time - BEGIN, rate)
        qd = np.tile(rate, (len(q), 1))
        needed = inverse_dynamics(real, q, qd, np.zeros_like(q))
        tau, wrench = needed.torque, needed.wrench
        for touch in touches:
            place = robot.places[touch.patch.link]
            T_then = robot.poses(touch.q)[touch.patch.node] @ place.T_node_link
            local = np.linalg.inv(T_then) @ np.append(touch.position, 1.0)
            points = _points(robot, q, touch.patch.link, local)
            pressed = force[:, None] * touch.force
            load = np.hstack([pressed, np.cross(points, pressed)])
            felt = contact_loads(robot, q, touch.patch.link, load)
            tau, wrench = tau - felt.torque, wrench - felt.wrench
        return add_noise(robot, Signals(self.time, q, qd, tau, wrench), rng)


def _points(robot: Robot, q: Array, link: str, local: Array) -> Array:
    """A point of a link (4,) in world (N, 3) [m] along a motion."""
    place = robot.places[link]
    return np.array([(robot.poses(row)[place.node] @ place.T_node_link @ local)[:3] for row in q])
