# SPDX-License-Identifier: Apache-2.0
"""The touches of one run and the signals they make.

Everything random follows from the seed, the cell and the number of the run, so that the result
does not depend on how runs are spread over processes.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from touchline.arrays import Array
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.arms import load_arm
from touchline.trials.cell import Cell
from touchline.trials.hands import HELD, RESTS, WAITS, in_cone, slide, tremor
from touchline.trials.moving import carried, moving_signals
from touchline.trials.touches import (
    Signals,
    Touch,
    TouchSampler,
    add_noise,
    resting_signals,
    sample_on_each,
)
from touchline.trials.wrong_model import RUNS, wrong_model

FIRST, APART = 0.55, 0.1  # s: the first onset, after settling and a quiet half second, then each
FRICTION = 0.5
# Of an arm that is not as its model: s, until the first onset, and of touching; Hz, of its swing.
LATER, LONGER, SWING = 2.0, 0.5, 0.5
ARMS_OFF = 16  # arms with errors of their own


@dataclass(frozen=True)
class Scene:
    """The touches of a run with their onsets [s], and the signals they make.

    Attributes:
        touches: as they begin.
        signals: of all sensors.
        places: (m, N, 3) [m], and `forces` (m, N, 3) [N], of each touch in world, at each sample.
    """

    touches: list[tuple[Touch, float]]
    signals: Signals
    places: Array
    forces: Array


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
    first, last, swing = (LATER, LONGER, SWING) if cell.model_error else (FIRST, cell.lasts, 0.0)
    onsets = [(touch, first + i * step) for i, touch in enumerate(touches)]
    duration = onsets[-1][1] + last
    if cell.alone:
        onsets = [pair for pair in onsets if pair[0].patch.segment == cell.alone]
    noise = np.random.default_rng([seed, run, cell.tier, 1]) if cell.tier else None
    if cell.hands != "steady":
        return _of_hands(cell, robot, skin, touches, np.random.default_rng([seed, run, 2]), noise)
    if not cell.speed:
        signals = resting_signals(robot, touches[0].q, onsets, duration, noise, cell.period)
        still = [(touch.position, touch.force) for touch, _ in onsets]
        shape = len(onsets), len(signals.time), 3
        places, forces = (
            np.broadcast_to(np.array(x)[:, None], shape) for x in zip(*still, strict=True)
        )
        return Scene(onsets, signals, places, forces)
    how = {"period": cell.period, "swing": swing, "turning": cell.turning}
    signals = moving_signals(robot, onsets, duration, cell.speed, chance, noise, **how)
    moved = [carried(robot, touch, signals.q) for touch, _ in onsets]
    places, turned = (np.array(x) for x in zip(*moved, strict=True))
    steady = np.array([touch.force for touch, _ in onsets])[:, None] + 0.0 * turned
    return Scene(onsets, signals, places, turned if cell.turning else steady)


def _of_hands(
    cell: Cell,
    robot: Robot,
    skin: Skin,
    touches: list[Touch],
    chance: np.random.Generator,
    noise: np.random.Generator | None,
) -> Scene:
    """Hands that tremble, or of which the last one slides, on an arm at rest."""
    step = APART if cell.begin == "apart" else 0.0
    onsets = [FIRST + i * step for i in range(len(touches))]
    path = np.zeros((0, 3))
    if cell.hands == "sliding":
        touches, path = _with_slide(skin, touches, cell.force, chance)
        duration = onsets[-1] + WAITS + len(path) * 1e-3 + RESTS
        path = np.repeat(path, max(1, round(1e-3 / cell.period)), axis=0)
    else:
        duration = onsets[-1] + HELD
    q, rest = touches[0].q, resting_signals(robot, touches[0].q, [], duration, None, cell.period)
    tau, wrench = rest.tau.copy(), rest.wrench.copy()
    places, forces = [], []
    for touch, onset in zip(touches, onsets, strict=True):
        place, force = (np.tile(x, (len(rest.time), 1)) for x in (touch.position, touch.force))
        if cell.hands == "trembling":
            force = in_cone(force + tremor(rest.time, chance), touch.normal, FRICTION)
        elif touch is touches[-1]:
            begin = int(np.searchsorted(rest.time, onset + WAITS))
            place[begin : begin + len(path)] = path
            place[begin + len(path) :] = path[-1]
        force *= (rest.time >= onset)[:, None]
        one = contact_loads(robot, q, touch.patch.link, np.eye(6))  # of each unit wrench
        felt = np.hstack([force, np.cross(place, force)])
        tau -= felt @ one.torque
        wrench -= np.tensordot(felt, one.wrench, axes=1)
        places.append(place)
        forces.append(force)
    exact = Signals(rest.time, rest.q, rest.qd, tau, wrench)
    timed = list(zip(touches, onsets, strict=True))
    return Scene(timed, add_noise(robot, exact, noise), np.array(places), np.array(forces))


def _with_slide(
    skin: Skin, touches: list[Touch], force: float, chance: np.random.Generator
) -> tuple[list[Touch], Array]:
    """The touches, the last of them where it can slide, and its places (P, 3) [m] in world."""
    sampler = TouchSampler(skin, chance, friction=FRICTION)
    held, last = touches[:-1], touches[-1]
    while (path := slide(skin.robot, sampler, last, FRICTION, chance)) is None:
        last = sampler.sample(force, last.q, tuple(touch.patch.body for touch in held))
    return [*held, last], path


def _sample(cell: Cell, robot: Robot, skin: Skin, chance: np.random.Generator) -> list[Touch]:
    if cell.begin == "segments":
        return sample_on_each(touched_segments(robot), skin, chance, cell.force, FRICTION)
    return TouchSampler(skin, chance, friction=FRICTION).sample_several(cell.contacts, cell.force)


def make_pipeline(
    robot: Robot,
    skin: Skin,
    rule: str = "likelihood",
    model_error: float = 0.0,
    period: float = 1e-3,
) -> Pipeline:
    """The pipeline as the benchmark uses it.

    It is told what is true of the benchmark: sensors err by the noise figures alone, how wrong the
    model is (where calibration does not tell), and how large the friction cone is.
    """
    return Pipeline(
        robot,
        period=period,
        skin=skin,
        rule=rule,
        wrench_error=0.0,
        torque_error=0.0,
        friction=FRICTION,
        model_error=model_error,
    )
