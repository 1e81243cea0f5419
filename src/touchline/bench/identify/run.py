# SPDX-License-Identifier: Apache-2.0
"""Residuals of real arms before and after identification, on recordings that played no part.

Each arm is described by its model alone. The first half of a recording, or the first file, goes
in; the rest is judged. K = 20 rad/s.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from touchline.arrays import Array, Mask
from touchline.bench.identify.arms import ARMS, KINOVA, Arm
from touchline.bench.identify.pushes import FORCE, detect
from touchline.errors import InputError
from touchline.identify.choice import regions_of
from touchline.identify.evidence import Evidence, filtered, gather
from touchline.identify.identification import identify, identify_all, rms
from touchline.identify.payload import payload_mass
from touchline.identify.rest import grids_of, learn
from touchline.logs import open_log
from touchline.model.robot import Robot, load_robot
from touchline.observer.samples import Samples

CHUNK = 1 << 15


@dataclass(frozen=True)
class Judgement:
    """Residuals (n,) [Nm] of an arm's joints before and after, RMS on what was not used."""

    arm: Arm
    before: Array
    after: Array
    learned: Array

    @property
    def share(self) -> float:
        """What is left of the sum over joints."""
        return float(self.after.sum() / self.before.sum())

    @property
    def learned_share(self) -> float:
        """What is left of it with a learned rest."""
        return float(self.learned.sum() / self.before.sum())


def judge(arm: Arm, data: Path) -> Judgement:
    """Identifies an arm from the first half, and judges on the rest."""
    robot, recordings, whole = _whole(arm, data)
    if len(arm.logs) > 1:
        first = whole.recording == 0
    else:
        first = np.arange(len(whole)) < len(whole) // 2
    return _judged(arm, robot, recordings, whole, first)


def judge_regions(arm: Arm, data: Path) -> list[Judgement]:
    """The same with each part of the workspace in turn judged by what was seen of the others."""
    robot, recordings, whole = _whole(arm, data)
    parts = regions_of(whole, np.ones(len(whole), dtype=bool))
    return [_judged(arm, robot, recordings, whole, part.train) for part in parts]


def _whole(arm: Arm, data: Path) -> tuple[Robot, list[list[Samples]], Evidence]:
    robot = described(arm, data)
    recordings = []
    for log in arm.logs[:2]:
        with open_log(data / log, robot.description) as recording:
            recordings.append(list(recording.chunks(CHUNK)))
    return robot, recordings, gather(robot, recordings)


def _judged(
    arm: Arm,
    robot: Robot,
    recordings: list[list[Samples]],
    whole: Evidence,
    first: Mask,
) -> Judgement:
    part, n = whole.part(first), whole.joints
    found, grids = identify(part), grids_of(part)
    hats = filtered(robot, recordings, grids.hats)
    rest = learn(found, grids, hats[first])
    left = found.left(whole)[:, :n]
    more = left + rest.applied(robot.joint_names, grids, hats)
    before = whole.residual()[:, :n]
    return Judgement(arm, *(rms(x[~first]) for x in (before, left, more)))


def tool_masses(data: Path) -> list[tuple[float, float]]:
    """Mass of the Kinova's tool and its standard error [kg], from each file alone."""
    robot = described(KINOVA, data)
    return [payload_mass(identify_all(read(robot, data / log))) for log in KINOVA.logs]


def described(arm: Arm, data: Path) -> Robot:
    """The robot of a description that is written for this moment alone."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.yaml"
        path.write_text(arm.text(data) + arm.log)
        return load_robot(path)


def read(robot: Robot, log: Path) -> Evidence:
    """The equations of a recording."""
    with open_log(log, robot.description) as recording:
        return gather(robot, [recording.chunks(CHUNK)])


def main(data: Path) -> int:
    """Prints the tables; 1 where a limit is missed.

    Raises:
        InputError: the recordings are not there.
    """
    if not data.is_dir():
        raise InputError(f"--data {data}: no such folder")
    print("RMS of the residuals at K = 20 rad/s, sum over joints, on data that played no part")
    head = f"{'arm':16} {'before':>8} {'after':>8} {'left':>7} {'limit':>7} {'learned':>8}"
    print(f"{head}  joints that got worse")
    missed = False
    for arm in ARMS:
        j = judge(arm, data)
        worse = np.flatnonzero(j.after > j.before)
        missed |= j.share > arm.limit or len(worse) > 0 or j.learned_share > j.share
        print(
            f"{arm.name:16} {j.before.sum():5.2f} Nm {j.after.sum():5.2f} Nm "
            f"{100 * j.share:5.1f} % {100 * arm.limit:5.0f} % {100 * j.learned_share:6.1f} %  "
            f"{', '.join(str(w + 1) for w in worse) or 'none'}"
        )
    print("the same in eight parts of the workspace, each judged by what was seen of the others")
    for arm in ARMS:
        shares = [(j.share, j.learned_share) for j in judge_regions(arm, data)]
        told = ", ".join(f"{100 * a:.1f} -> {100 * b:.1f}" for a, b in shares)
        print(f"{arm.name:16} {told} %")
    masses = tool_masses(data)
    print("tool of the Kinova, from each file alone: ", end="")
    print(", ".join(f"{mass:.3f} +- {error:.3f} kg" for mass, error in masses))
    missed |= abs(masses[0][0] - masses[1][0]) > 0.05
    print(f"\nPushes of {FORCE:g} N computed into that data, by the model alone and calibrated:")
    print(f"{'arm':16} {'':7} {'found':>8} {'false':>6}  in contact without pushes")
    for arm in ARMS:
        told = detect(arm, data)
        missed |= told["after"].found < told["before"].found
        for name, d in told.items():
            found = f"{d.found}/{d.pushes}"
            print(f"{arm.name:16} {name:7} {found:>8} {d.false:6d}  {100 * d.share:.1f} %")
    return int(missed)
