# SPDX-License-Identifier: Apache-2.0
"""Arms calibrated on two minutes of motion: phantoms elsewhere, and pushes found at rest."""

import sys
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from tqdm import tqdm

from touchline.arrays import Array
from touchline.bench.tables import Row, aligned
from touchline.calibrate.noise import measure_noise
from touchline.calibrate.run import growth
from touchline.detector.thresholds import make_thresholds
from touchline.identify.described import identified_robot
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.samples import Samples
from touchline.pipeline.pipeline import Pipeline
from touchline.result.event import Event
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import (
    MotionMaker,
    Trajectory,
    imperfect,
    random_trajectory,
)
from touchline.trials.touches import TouchSampler
from touchline.trials.wrong_model import RATE, with_thresholds

NOISE = 1  # tier of the localization benchmark: 0.05 N, 0.01 Nm, 0.05 Nm
MINUTES = 2  # of motion for the calibration
POSES, MOTIONS, SECONDS = 20, 10, 30.0  # s each, without contact
PUSHES, FORCE, PUSHED, RELEASED, RISE, LASTS = 20, 2.0, 2.0, 3.0, 0.05, 4.0  # N, s; at rest
HEAD = (
    "arm",
    "what is wrong",
    "thresholds",
    "phantoms: 10 min standing",
    "5 min moving",
    "2 N at rest",
    "thresholds without the bias",
)


@dataclass(frozen=True)
class Wrong:
    """What is wrong with an arm.

    Attributes:
        name: in the table.
        masses: 1 sigma of the relative errors of masses and inertias.
        bias: constant force [N] on each sensor.
    """

    name: str
    masses: float = 0.0
    bias: float = 0.0


WRONGS = (Wrong("nothing"), Wrong("masses 2 %", masses=0.02), Wrong("bias 2 N", bias=2.0))


@dataclass(frozen=True)
class Told:
    """What was felt.

    Attributes:
        standing, moving: events without a contact.
        found: pushes at rest.
    """

    standing: int
    moving: int
    found: int


class Arm:
    """An arm as described and as it is.

    Args:
        robot: as described.
        wrong: with it.
        seed: of what is random.
    """

    def __init__(self, robot: Robot, wrong: Wrong, seed: int) -> None:
        self.robot, self.wrong, self._seed = robot, wrong, seed
        self.skin = Skin(robot)
        self.real = imperfect(robot, wrong.masses, 1000 + seed) if wrong.masses else robot

    def calibrated(self) -> Robot:
        """As by `touchline calibrate`."""
        found = identify(gather(self.robot, self._recordings()))
        robot = identified_robot(found)
        noise = measure_noise(robot, self._recordings())
        robot = Robot(replace(robot.description, noise=noise), robot.mechanism)
        return with_thresholds(robot, self._recordings, growth(found))

    def _recordings(self) -> Iterable[list[Samples]]:
        maker = self._maker(60.0)
        for minute in range(MINUTES):
            rng = np.random.default_rng((self._seed, 0, minute))
            yield [self._read(maker.samples(random_trajectory(self.robot, rng), rng))]

    def told(self, robot: Robot) -> Told:
        """What a description of the arm takes for contacts, and finds."""
        free = self._maker(SECONDS)
        events = {still: 0 for still in (True, False)}
        for still, count in ((True, POSES), (False, MOTIONS)):
            for k in range(count):
                rng = np.random.default_rng((self._seed, 1 + still, k))
                path = self._path(rng, still)
                events[still] += len(self._felt(robot, self._read(free.samples(path, rng))))
        found = sum(self._finds(robot, k) for k in range(PUSHES))
        return Told(events[True], events[False], found)

    def _finds(self, robot: Robot, k: int) -> bool:
        rng = np.random.default_rng((self._seed, 3, k))
        maker = self._maker(LASTS)
        q, qd, loads = maker.loads(self._path(rng, still=True))
        felt = tuple(name for name in self.robot.segment_names if name != "root") or None
        touch = TouchSampler(self.skin, rng, felt, floor=-np.inf).sample(FORCE, q[0])
        up, down = ((maker.time - t) / RISE for t in (PUSHED, RELEASED))
        course = np.clip(up, 0.0, 1.0) - np.clip(down, 0.0, 1.0)
        wrench = course[:, None] * np.hstack([touch.force, np.cross(touch.position, touch.force)])
        contact = contact_loads(self.robot, q, touch.patch.link, wrench)
        n = q.shape[1]
        loads[:, :n] -= contact.torque
        loads[:, n:] -= contact.wrench.reshape(len(q), -1)
        events = self._felt(robot, self._read(maker.sensed(q, qd, loads, rng)))
        return any(PUSHED <= event.detected <= RELEASED + RISE for event in events)

    def _maker(self, seconds: float) -> MotionMaker:
        return MotionMaker(self.robot, self.real, RATE, seconds)

    def _path(self, rng: np.random.Generator, still: bool) -> Trajectory:
        path = random_trajectory(self.robot, rng)
        return replace(path, amplitude=0.0 * path.amplitude) if still else path

    def _read(self, samples: Samples) -> Samples:
        force = np.zeros(6)
        force[:3] = self.wrong.bias / np.sqrt(3.0)
        return replace(samples, wrench=samples.wrench + force)

    def _felt(self, robot: Robot, s: Samples) -> list[Event]:
        pipeline = Pipeline(robot, period=1.0 / RATE, skin=self.skin)
        pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
        return pipeline.events


def main(arms: Sequence[str], runs: int, seed: int) -> None:
    """Prints a line for each arm and what is wrong with it, before and after calibration.

    Args:
        arms: names, see `load_arm`.
        runs: arms with errors of their own on each line.
        seed: of all that is random.
    """
    lines: list[Row] = [HEAD]
    progress = tqdm(
        total=len(arms) * len(WRONGS) * runs, file=sys.stderr, leave=False, disable=None
    )
    for name in arms:
        robot, unbiased = load_arm(name, NOISE), []
        for wrong in WRONGS:
            told: dict[str, list[Told]] = {"from noise": [], "calibrated": []}
            ratios = []
            for run in range(runs):
                arm = Arm(robot, wrong, seed + run)
                calibrated = arm.calibrated()
                told["from noise"].append(arm.told(robot))
                told["calibrated"].append(arm.told(calibrated))
                if wrong == WRONGS[0]:
                    unbiased.append(_contacts(calibrated))
                ratios.append((_contacts(calibrated) / unbiased[run]).max())
                progress.update()
            for kind, of in told.items():
                ratio = f"{max(ratios):.2f} times" if wrong.bias and kind == "calibrated" else "-"
                lines.append((name, wrong.name, kind, *_sums(of), ratio))
    progress.close()
    print(
        f"Arms calibrated on {MINUTES} min of motion, {runs} of each kind; events without contact"
    )
    print("by thresholds from the noise figures, and by calibrated ones:")
    print(aligned(lines))


def _contacts(robot: Robot) -> Array:
    """Thresholds (r,) of the rows [N or Nm]."""
    return np.array([row.contact for row in make_thresholds(robot, 1.0 / RATE).rows])


def _sums(told: Sequence[Told]) -> tuple[str, str, str]:
    found = sum(x.found for x in told)
    standing, moving = sum(x.standing for x in told), sum(x.moving for x in told)
    return str(standing), str(moving), f"{found}/{PUSHES * len(told)}"
