# SPDX-License-Identifier: Apache-2.0
"""The arms that are touched: not quite as their models say, calibrated on their own motion."""

from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot
from touchline.pipeline.pipeline import Pipeline
from touchline.touch.touch import Touch, TouchEvent
from touchline.trials.finger import Finger, signals_of
from touchline.trials.wrong_model import wrong_model

ERROR = 0.02  # 1 sigma of the relative errors of masses and inertias
COUNT = 4  # arms with errors of their own, which take turns
PERIOD = 1e-3  # s
LINKS = tuple(f"panda_link{i}" for i in range(2, 7))  # that are touched


@dataclass(frozen=True)
class Arm:
    """A Panda with a base sensor and seven joint torques.

    Attributes:
        robot: as described and calibrated.
        real: as it moves.
        skin: its surfaces.
    """

    robot: Robot
    real: Robot
    skin: Skin

    def with_widgets(self, widgets: dict[str, WidgetDescription]) -> Robot:
        """The robot with another `interface`."""
        return Robot(replace(self.robot.description, interface=widgets), self.robot.mechanism)

    def feel(
        self,
        widgets: dict[str, WidgetDescription],
        fingers: list[Finger],
        q: Array,
        time: Array,
        rng: np.random.Generator,
        speed: float = 0.0,
    ) -> tuple[Touch, list[TouchEvent]]:
        """What is felt of fingers on an arm with these widgets, about joint positions `q` (n,)."""
        robot = self.with_widgets(widgets)
        s = signals_of(self.real, q, fingers, time, speed, rng, rng)
        pipeline, touch = Pipeline(robot, skin=self.skin), Touch(robot, self.skin)
        events: list[TouchEvent] = []
        for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            events += touch.update(pipeline.update(*row))
        return touch, events


def arm(number: int, tier: int = 1) -> Arm:
    """An arm with so much noise (`trials.arms.TIERS`); numbers repeat after `COUNT`."""
    return _arm(number % COUNT, tier)


@cache
def _arm(number: int, tier: int) -> Arm:
    robot, real = wrong_model("panda", tier, ERROR, number, identified=True)
    return Arm(robot, real, Skin(robot))
