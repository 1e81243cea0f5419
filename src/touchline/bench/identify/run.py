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

from touchline.errors import InputError
from touchline.identify.evidence import Evidence, gather
from touchline.identify.identification import identify, identify_all, rms
from touchline.identify.payload import payload_mass
from touchline.logs import open_log
from touchline.model.robot import Robot, load_robot

Array = NDArray[np.float64]

CHUNK = 1 << 15


@dataclass(frozen=True)
class Arm:
    """An arm and its recordings.

    Attributes:
        name: for the table.
        description: text of its `robot.yaml`; {data} stands for the folder of recordings.
        logs: within that folder; of a single one the first half goes in.
        limit: part of the sum of residuals that may be left, as is required.
    """

    name: str
    description: str
    logs: tuple[str, ...]
    limit: float


_PANDA = """\
name: panda
model: package://example-robot-data/robots/panda_description/urdf/panda.urdf
locked: {panda_finger_joint1: 0.0}
links: {panda_hand: {mass: 0.0}, panda_leftfinger: {mass: 0.0}, panda_rightfinger: {mass: 0.0}}
log:
  joint_names: {panda_joint1: fer_joint1, panda_joint2: fer_joint2, panda_joint3: fer_joint3,
                panda_joint4: fer_joint4, panda_joint5: fer_joint5, panda_joint6: fer_joint6,
                panda_joint7: fer_joint7}
"""
_UR10 = """\
name: ur10
model: package://example-robot-data/robots/ur_description/urdf/ur10_robot.urdf
joints:
  - {name: shoulder_pan_joint, torque: motor}
  - {name: shoulder_lift_joint, torque: motor}
  - {name: elbow_joint, torque: motor}
  - {name: wrist_1_joint, torque: motor}
  - {name: wrist_2_joint, torque: motor}
  - {name: wrist_3_joint, torque: motor}
"""
_KUKA = """\
name: lwr4
model: {data}/kuka_lwr4/kuka_lwr4.urdf
package_dirs: ["{data}"]
"""
KINOVA = """\
name: gen3
model: {data}/kinova_gen3/kinovaGen3V12.urdf
log:
  time: {{column: Time, factor: 0.001}}
  q: "Position{{i1}}"
  qd: "Velocity{{i1}}"
  tau: "TorqueSm{{i1}}"
"""
KINOVA_LOGS = "kinova_gen3/opti_traj_testing1.csv", "kinova_gen3/opti_traj_testing2.csv"
ARMS = (
    Arm(
        "Panda, no hand",
        _PANDA.replace("{", "{{").replace("}", "}}"),
        ("panda_ur10_rosbag2/panda_exciting_trajectory.db3",),
        0.55,
    ),
    Arm(
        "UR10, currents",
        _UR10.replace("{", "{{").replace("}", "}}"),
        ("panda_ur10_rosbag2/ur10_exciting_trajectory.db3",),
        0.27,
    ),
    Arm(
        "KUKA LWR4+",
        _KUKA,
        ("kuka_lwr4/free_motion_1.csv.gz", "kuka_lwr4/free_motion_2.csv.gz"),
        0.53,
    ),
)


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
    robot = described(arm.description, data)
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
    return [payload_mass(identify_all(read(robot, data / log))) for log in KINOVA_LOGS]


def described(text: str, data: Path) -> Robot:
    """The robot of a description that is written for this moment alone."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "robot.yaml"
        path.write_text(text.format(data=data.resolve()))
        return load_robot(path)


def read(robot: Robot, log: Path) -> Evidence:
    """The equations of a recording."""
    with open_log(log, robot.description) as recording:
        return gather(robot, [recording.chunks(CHUNK)])


def main(data: Path) -> int:
    """Prints the table; 1 where a limit is missed.

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
    return int(missed)
