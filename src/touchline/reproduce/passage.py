# SPDX-License-Identifier: Apache-2.0
"""The motion of figure 4: past the arm's best conditioned configuration, across a singularity."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from touchline.arrays import Array
from touchline.model.robot import Robot, load_robot
from touchline.reproduce.conditioning import EndEffector, best_conditioned, nearby_singularity
from touchline.reproduce.prescribed import Motion, Wave, coupling, prescribed_motion
from touchline.simulation.setup import read_setup

RATE = 1000.0  # Hz
BEST, SINGULAR = 2.0, 6.0  # when the arm passes these configurations [s]
OVERSHOOT = 1.3  # how far beyond the singular configuration the arm goes, from the best one
SWAY = (0.9, 0.3, 0.0, 0.0, 1.1, 0.0, 0.0)  # amplitudes [rad] of what does not lead there
QUICK_SWAY = (0.0, 0.0, -0.5, 0.0, 0.0, 0.0, -0.6)
LIFT = (0.0, 0.3, 0.0, 0.0, 0.0, 0.6, 0.0)


@dataclass(frozen=True)
class Passage:
    """The arm's motion past its best conditioned configuration and across a singularity.

    Attributes:
        robot: with a torque sensor in every joint, which the classical route needs.
        best, singular: configurations (n,) [rad], passed at `BEST` and `SINGULAR`.
        motion: the motion and ideal readings.
        condition: (N,) condition number of the end effector's Jacobian.
    """

    robot: Robot
    best: Array
    singular: Array
    motion: Motion
    condition: Array

    @cached_property
    def coupling(self) -> Array:
        """`M_vq M^-1` (N, k, 6, n), from the same code as the readings."""
        return coupling(self.robot, self.motion.q)


def passage(seed: int, span: tuple[float, float]) -> Passage:
    """Finds both configurations and moves the arm past them.

    Args:
        seed: of the search.
        span: first and last instant of the motion that is looked at [s].
    """
    robot = load_robot("sara-full")
    setup = read_setup(robot)
    effector = EndEffector(robot, "tool")
    best = best_conditioned(effector, setup.lower, setup.upper, seed)
    singular = nearby_singularity(effector, best)
    time = np.arange(round(span[0] * RATE), round(span[1] * RATE) + 1) / RATE
    center, waves = _path(best, singular)
    motion = prescribed_motion(robot, time, center, waves, BEST)
    return Passage(robot, best, singular, motion, effector.condition(motion.q))


def _path(best: Array, singular: Array) -> tuple[Array, list[Wave]]:
    """From one side to `best`, where it turns, for joints are at their limits there, and beyond.

    The way between both configurations is `(1 - cos)`, which turns at `best` and overshoots
    `singular`. The other waves vanish at both, so that the arm passes them exactly.
    """
    rate = np.arccos(1 - 2 / OVERSHOOT) / (SINGULAR - BEST)
    way = (singular - best) * OVERSHOOT / 2
    beat = np.pi / (SINGULAR - BEST)
    waves = [
        Wave(-way, rate, np.pi / 2),
        Wave(np.array(SWAY), beat),
        Wave(np.array(QUICK_SWAY), 2 * beat),
        Wave(-np.array(LIFT) / 2, 2 * beat, np.pi / 2),
    ]
    return best + way + np.array(LIFT) / 2, waves
