# SPDX-License-Identifier: Apache-2.0
"""A person leads the simulated arm by its handle: a hand that wanders, jerks and trembles.

The hand is a spring and a damper between the handle and a point that the person has in mind; the
point wanders and now and then leaps, as fast as an arm's muscles follow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Touch, cross, no_touch
from touchline.simulation.control import JointImpedance, hold
from touchline.simulation.noise import SensorNoise
from touchline.simulation.plant import Plant
from touchline.simulation.readings import Readings
from touchline.simulation.sensing import sense
from touchline.simulation.setup import Setup

STIFFNESS, DAMPING = 400.0, 25.0  # N/m, N s/m of a hand and arm
STRONGEST = 80.0  # N that the person applies
WAVES, WANDER, WANDER_RATE = 4, 0.06, (0.05, 0.5)  # number, m each, Hz
LEAPS, LEAP, FOLLOW = 0.3, 0.12, 0.12  # per second, m, s in which a leap is followed
TREMOR, TREMOR_RATE = 0.5, 9.0  # N, Hz
GRASP = 0.3  # s in which the hand takes hold
LED_STIFFNESS, LED_DAMPING = 0.02, 0.2  # of the robot's own gains: an arm that can be led


@dataclass(frozen=True)
class HandMotion:
    """Where the person wants the handle, relative to where it was grasped.

    Attributes:
        wave: (WAVES, 3) amplitudes [m], rates (WAVES,) [rad/s], phases (WAVES, 3).
        leaps: (L,) times [s] and (L, 3) displacements [m].
    """

    wave: Array
    rate: Array
    phase: Array
    leap_time: Array
    leap: Array

    @staticmethod
    def draw(rng: np.random.Generator, seconds: float) -> "HandMotion":
        """A random motion of a length [s]."""
        count = rng.poisson(LEAPS * seconds)
        return HandMotion(
            rng.uniform(-WANDER, WANDER, (WAVES, 3)),
            2 * np.pi * rng.uniform(*WANDER_RATE, WAVES),
            rng.uniform(0.0, 2 * np.pi, (WAVES, 3)),
            np.sort(rng.uniform(0.0, seconds, count)),
            rng.uniform(-LEAP, LEAP, (count, 3)),
        )

    def at(self, time: Array) -> Array:
        """Displacements (N, 3) [m] at times (N,) [s]; a leap leads away and back within 2 s."""
        t = np.asarray(time, float)
        angle = self.rate * t[:, None]
        waves = np.sin(angle[:, :, None] + self.phase) - np.sin(self.phase)
        way = np.einsum("nwk,wk->nk", waves, self.wave)
        since = t[:, None] - self.leap_time
        risen = 0.5 - 0.5 * np.cos(np.pi * np.clip(since / FOLLOW, 0.0, 1.0))
        gone = 0.5 - 0.5 * np.cos(np.pi * np.clip((since - 1.0) / 1.0, 0.0, 1.0))
        return way + (risen - gone) @ self.leap


class GuidingHand:
    """The hand on a link; one slot.

    Args:
        link: that is held.
        point: (3,) in the link's frame [m].
        motion: of the hand.
        times: (N,) at which forces will be asked for, evenly spaced [s].
        rng: of the tremor.
    """

    physical = False

    def __init__(
        self, link: str, point: Array, motion: HandMotion, times: Array, rng: np.random.Generator
    ) -> None:
        self._mj: Any = import_module("mujoco")  # its stubs lack most names
        self.link, self.point = link, np.asarray(point, float)
        self._times, self._wanted = times, motion.at(times)
        phase = rng.uniform(0.0, 2 * np.pi, 3)
        shake = 2 * np.pi * TREMOR_RATE * times[:, None] + phase
        self._tremor = TREMOR * np.sin(shake)
        self._grasped: Array | None = None
        self._touch = no_touch(link)

    def __len__(self) -> int:
        return 1

    def apply(self, plant: Plant) -> bool:
        """Sets the hand's force for the plant's present time; to be called after `evaluate`."""
        data, body = plant.data, plant.bodies[self.link]
        arm = data.xmat[body].reshape(3, 3) @ self.point + data.xpos[body] - data.xipos[body]
        point = data.xipos[body] + arm
        grasped = self._grasped = point.copy() if self._grasped is None else self._grasped
        jacobian = np.empty((3, plant.model.nv))
        self._mj.mj_jac(plant.model, data, jacobian, None, point, body)
        period = self._times[1] - self._times[0]
        i = min(max(round((plant.time - self._times[0]) / period), 0), len(self._times) - 1)
        grip = min(max((plant.time - self._times[0]) / GRASP, 0.0), 1.0)
        pull = STIFFNESS * (grasped + self._wanted[i] - point)
        force = grip * (pull - DAMPING * (jacobian @ data.qvel) + self._tremor[i])
        force *= min(1.0, STRONGEST / max(float(np.linalg.norm(force)), 1e-9))
        data.xfrc_applied[body, :3], data.xfrc_applied[body, 3:] = force, cross(arm, force)
        self._touch = Touch(True, self.link, point, force, np.zeros(3))
        return True

    def touches(self, plant: Plant) -> list[Touch]:
        """What acts now."""
        return [self._touch]


def led(setup: Setup, q: Array) -> JointImpedance:
    """A controller under which the arm can be led by hand, about a pose (n,)."""
    if setup.stiffness is None or setup.damping is None:
        n = len(q)
        return JointImpedance(hold(q), np.full(n, 10.0), np.full(n, 5.0))
    return JointImpedance(hold(q), LED_STIFFNESS * setup.stiffness, LED_DAMPING * setup.damping)


def guided_samples(
    robot: Robot,
    plant: Plant,
    setup: Setup,
    hand: tuple[str, Array],
    seconds: float,
    seed: Sequence[int],
    noise: SensorNoise | None = None,
) -> tuple[Samples, Array]:
    """What the sensors log at the plant's rate while the arm is led, and the hand's force (N, 3).

    A lean loop: every input is held over a step, and readings are taken once a step. Forces of a
    hand change by less than 1 N from one millisecond to the next, so no jump has to be averaged.

    Args:
        robot: with a handle.
        plant: of the robot; its rate is that of the log.
        setup: of the robot.
        hand: the link that is held and where (3,), in its frame [m].
        seconds: duration.
        seed: of all that is random.
        noise: of the sensors.
    """
    rng = np.random.default_rng(list(seed))
    rows = round(seconds * plant.rate)
    times = np.arange(rows) / plant.rate
    q = setup.home + rng.uniform(-0.3, 0.3, len(setup.home))
    q = np.clip(q, setup.lower, setup.upper)
    holding = GuidingHand(*hand, HandMotion.draw(rng, seconds), times, rng)
    controller = led(setup, q)
    readings, forces = Readings.empty(plant, rows), np.empty((rows, 3))
    plant.reset(q)
    for row in range(rows):
        plant.evaluate()
        plant.command(controller.torque(plant))
        holding.apply(plant)
        plant.accelerate()
        now = plant.read()
        readings.put(row, plant, now, now)
        forces[row] = holding.touches(plant)[0].force
        plant.integrate()
    return sense(robot, readings, noise, rng), forces
