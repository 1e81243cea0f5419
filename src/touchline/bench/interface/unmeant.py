# SPDX-License-Identifier: Apache-2.0
"""Hours of motion and of pushes beside all buttons: how often does one call back all the same?"""

import sys
from dataclasses import dataclass

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.interface.arms import LINKS, PERIOD, Arm, arm
from touchline.bench.interface.pressing import RADIUS
from touchline.bench.tables import Row
from touchline.detector.tail import poisson_interval
from touchline.localizer.skin import Patch
from touchline.model.description import WidgetDescription
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.touch.touch import Touch
from touchline.trials.finger import rising
from touchline.trials.free_motion import MotionMaker, random_trajectory
from touchline.trials.touches import TouchSampler

SECONDS = 60.0  # of a recording
FIRST, PAUSE = 2.0, (1.0, 6.0)  # s until the first push, and between two
LENGTH = 0.1, 2.0  # s, of a push
FORCE = 3.0, 40.0  # N
POSTURES = 5  # of a push in which a finger has to reach its place
CLEAR = 0.03  # m, at least, from a push to the rim of a button


@dataclass
class Hours:
    """What became of them.

    Attributes:
        minutes: of motion.
        pushes: beside all buttons, `felt` of them.
        false: presses that were told.
    """

    minutes: int = 0
    pushes: int = 0
    felt: int = 0
    false: int = 0

    def row(self) -> Row:
        """Of the table."""
        hours = self.minutes / 60.0
        most = 10.0 * poisson_interval(self.false)[1] / hours
        felt = f"{self.felt}/{self.pushes}"
        return f"{hours:.3g} h in motion", felt, str(self.false), f"{most:.2g}"


def unmeant(minutes: int, rng: np.random.Generator) -> list[Row]:
    """Arms that move and are pushed beside five buttons, one on each link."""
    found = Hours()
    for number in tqdm(range(minutes), file=sys.stderr, leave=False, disable=None):
        _one_minute(found, arm(number), rng)
    return [found.row()]


def _one_minute(found: Hours, touched: Arm, rng: np.random.Generator) -> None:
    patches = [patch for patch in touched.skin.patches if patch.link in LINKS]
    buttons = {}
    for patch in patches:
        at, _ = _somewhere(patch, rng)
        buttons[patch.link] = WidgetDescription("button", patch.link, at=tuple(at), radius=RADIUS)
    samples, pushes = _pushed(touched, patches, buttons, rng)
    robot = touched.with_widgets(buttons)
    pipeline, touch = Pipeline(robot, skin=touched.skin), Touch(robot, touched.skin)
    felt: list[float] = []
    rows = (samples.time, samples.q, samples.qd, samples.tau, samples.wrench)
    for row in zip(*rows, strict=True):
        result = pipeline.update(*row)
        found.false += sum(event.kind == "press" for event in touch.update(result))
        felt += [result.time] * bool(result.contacts)
    times = np.array(felt)
    found.minutes += 1
    found.pushes += len(pushes)
    found.felt += sum(bool(((begin < times) & (times < end)).any()) for begin, end in pushes)


def _pushed(
    touched: Arm,
    patches: list[Patch],
    buttons: dict[str, WidgetDescription],
    rng: np.random.Generator,
) -> tuple[Samples, list[tuple[float, float]]]:
    """A recording in motion, and when it is pushed [s]."""
    maker = MotionMaker(touched.robot, touched.real, 1.0 / PERIOD, SECONDS)
    q, qd, loads = maker.loads(random_trajectory(touched.robot, rng))
    n, pushes, begin = q.shape[1], [], FIRST
    while begin < SECONDS - LENGTH[1]:
        end = begin + rng.uniform(*LENGTH)
        rows = np.flatnonzero((maker.time >= begin) & (maker.time <= end))
        patch, (point, normal) = _beside(touched, q[rows], patches, buttons, rng)
        size = rng.uniform(*FORCE) * rising(maker.time[rows], begin, end)
        place = touched.real.places[patch.link]
        T = np.array([touched.real.poses(x)[place.node] @ place.T_node_link for x in q[rows]])
        at = T[:, :3, :3] @ point + T[:, :3, 3]
        force = -size[:, None] * (T[:, :3, :3] @ normal)
        shown = contact_loads(
            touched.real, q[rows], patch.link, np.hstack([force, np.cross(at, force)])
        )
        loads[rows, :n] -= shown.torque
        loads[rows, n:] -= shown.wrench.reshape(len(rows), -1)
        pushes.append((begin, end))
        begin = end + rng.uniform(*PAUSE)
    return maker.sensed(q, qd, loads, rng), pushes


def _beside(touched: Arm, q: Array, patches, buttons, rng) -> tuple[Patch, tuple[Array, Array]]:
    """A place on a link that is on no button, and that a finger reaches in postures `q` (N, n)."""
    sampler = TouchSampler(touched.skin, rng, floor=-np.inf)
    while True:
        patch = patches[rng.integers(len(patches))]
        point, normal = _somewhere(patch, rng)
        if np.linalg.norm(point - np.array(buttons[patch.link].at)) <= RADIUS + CLEAR:
            continue
        for x in q[:: max(1, len(q) // POSTURES)]:
            T = touched.robot.poses(x)[patch.node] @ patch.T_node_link
            if not sampler.reachable(x, T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ normal):
                break
        else:
            return patch, (point, normal)


def _somewhere(patch: Patch, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random place (3,) [m] on a link's surface and its outward normal, in its frame."""
    surface = patch.surface
    face = rng.choice(len(surface.faces), p=surface.areas / surface.areas.sum())
    return surface.vertices[surface.faces[face]].mean(axis=0), surface.normals[face]
