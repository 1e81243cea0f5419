# SPDX-License-Identifier: Apache-2.0
"""Residuals of real arms before and after identification, on recordings that played no part.

Each arm is described by its model alone. The first half of a recording, or the first file, goes
in; the rest is judged. K = 20 rad/s.
"""

from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from touchline.bench.identify.arms import ARMS, KINOVA, Arm
from touchline.bench.identify.pushes import FORCE, detect
from touchline.errors import InputError
from touchline.identify.evidence import Evidence, gather
from touchline.identify.identification import identify, identify_all, rms
from touchline.identify.payload import payload_mass
from touchline.logs import open_log
from touchline.model.robot import Robot, load_robot

Array = NDArray[np.float64]

CHUNK = 1 << 15


@dataclass(frozen=True)
class Judgement:
    """Residuals (n,) [Nm] of an arm's joints before and after, RMS on what was not used."""

    arm: Arm
    before: Array
    after: Array

    @property
    def share(self) -> float:
        """What is left of the sum over joints."""
        return float(self.after.sum() / self.before.sum())


def judge(arm: Arm, data: Path) -> Judgement:
    """Identifies an arm from the first half, and judges on the rest."""
    robot = described(arm, data)
    recordings = [read(robot, data / log) for log in arm.logs]
    if len(recordings) > 1:
        first, rest = recordings[:2]
    else:
        (whole,) = recordings
        index = np.arange(len(whole))
        first, rest = whole.part(index < len(index) // 2), whole.part(index >= len(index) // 2)
    found = identify(first)
    return Judgement(arm, rms(rest.residual()), rms(found.left(rest)))


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
    print(f"{'arm':16} {'before':>8} {'after':>8} {'left':>7} {'limit':>7}  joints that got worse")
    missed = False
    for arm in ARMS:
        j = judge(arm, data)
        worse = np.flatnonzero(j.after > j.before)
        missed |= j.share > arm.limit or len(worse) > 0
        print(
            f"{arm.name:16} {j.before.sum():5.2f} Nm {j.after.sum():5.2f} Nm "
            f"{100 * j.share:5.1f} % {100 * arm.limit:5.0f} %  "
            f"{', '.join(str(w + 1) for w in worse) or 'none'}"
        )
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
