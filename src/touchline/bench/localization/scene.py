# SPDX-License-Identifier: Apache-2.0
"""The touches of one run and the signals they make.

Everything random follows from the seed, the cell and the number of the run, so that the result
does not depend on how runs are spread over processes.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from touchline.bench.localization.arm import load_arm
from touchline.bench.localization.cell import Cell
from touchline.bench.localization.moving import moving_signals
from touchline.bench.localization.wrong_model import RUNS, wrong_model
from touchline.bench.touches import (
    Signals,
    Touch,
    TouchSampler,
    resting_signals,
    sample_on_each,
)
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot

Array = NDArray[np.float64]

FORCE = 20.0  # N
FIRST, APART = 0.55, 0.1  # s: the first onset, after settling and a quiet half second, then each
FRICTION = 0.5
# Of an arm that is not as its model: s, until the first onset, and of touching; Hz, of its swing.
LATER, LONGER, SWING = 2.0, 0.5, 0.5
ARMS_OFF = 16  # arms with errors of their own


@dataclass(frozen=True)
class Scene:
    """The touches of a run with their onsets [s], and the signals they make.

    Forces are constant in world, or turn with their links (`turning`).
    """

    touches: list[tuple[Touch, float]]
    signals: Signals
    turning: bool = False


@lru_cache(maxsize=8)
def arm_and_skin(arm: str, tier: int) -> tuple[Robot, Skin]:
    """An arm and its surfaces, kept from run to run."""
    robot = load_arm(arm, tier)
    return robot, Skin(robot)


def told_and_real(cell: Cell, run: int) -> tuple[Robot, Robot, Skin]:
    """What the pipeline is told of the arm of a run, the arm that moves, and its surfaces."""
    robot, skin = arm_and_skin(cell.arm, cell.tier)
    if not cell.model_error:
        return robot, robot, skin
    number = run // RUNS % ARMS_OFF
    told, real = wrong_model(cell.arm, cell.tier, cell.model_error, number)
    return told if cell.calibrated else robot, real, skin


def touched_segments(robot: Robot) -> tuple[str, ...]:
    """Those that begin at a six-axis sensor."""
    return tuple(name for name in robot.segment_names if name != "root")


def make_scene(cell: Cell, run: int, seed: int = 0) -> Scene:
    """The touches and signals of one run.

    Tiers, timing, and whether a touch is alone do not change pose and places.
    """
    _, robot, skin = told_and_real(cell, run)
    chance = np.random.default_rng([seed, run, cell.contacts, *cell.arm.encode()])
    touches = _sample(cell, robot, skin, chance)
    step = APART if cell.begin == "apart" else 0.0
    first, last, swing = (LATER, LONGER, SWING) if cell.model_error else (FIRST, APART, 0.0)
    onsets = [(touch, first + i * step) for i, touch in enumerate(touches)]
    duration = onsets[-1][1] + last
    if cell.alone:
        onsets = [pair for pair in onsets if pair[0].patch.segment == cell.alone]
    noise = np.random.default_rng([seed, run, cell.tier, 1]) if cell.tier else None
    if not cell.speed:
        return Scene(onsets, resting_signals(robot, touches[0].q, onsets, duration, noise))
    signals = moving_signals(
        robot, onsets, duration, cell.speed, chance, noise, swing=swing, turning=cell.turning
    )
    return Scene(onsets, signals, cell.turning)


def _sample(cell: Cell, robot: Robot, skin: Skin, chance: np.random.Generator) -> list[Touch]:
    if cell.begin == "segments":
        return sample_on_each(touched_segments(robot), skin, chance, FORCE, FRICTION)
    return TouchSampler(skin, chance, friction=FRICTION).sample_several(cell.contacts, FORCE)


def true_places(robot: Robot, scene: Scene, q: Array) -> Array:
    """The touched points (m, 3) [m] in world at joint positions `q` (n,)."""
    start, now = robot.poses(scene.touches[0][0].q), robot.poses(q)
    places = []
    for touch, _ in scene.touches:
        node = touch.patch.node
        local = start[node][:3, :3].T @ (touch.position - start[node][:3, 3])
        places.append(now[node][:3, :3] @ local + now[node][:3, 3])
    return np.array(places)
