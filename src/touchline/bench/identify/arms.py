# SPDX-License-Identifier: Apache-2.0
"""Real arms and their recordings; each is described by its model alone."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Arm:
    """An arm and its recordings.

    Attributes:
        name: for the table.
        description: text of its `robot.yaml`; {data} stands for the folder of recordings.
        log: more of it: what the recordings call the signals.
        logs: within that folder; of a single one the first half goes in.
        limit: part of the sum of residuals that may be left, as is required.
    """

    name: str
    description: str
    logs: tuple[str, ...]
    limit: float
    log: str = ""

    def text(self, data: Path) -> str:
        """The description, without `log`."""
        return self.description.replace("{data}", str(data.resolve()))


_PANDA = """\
name: panda
model: package://example-robot-data/robots/panda_description/urdf/panda.urdf
locked: {panda_finger_joint1: 0.0}
links: {panda_hand: {mass: 0.0}, panda_leftfinger: {mass: 0.0}, panda_rightfinger: {mass: 0.0}}
"""
_PANDA_LOG = """\
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
_KINOVA = """\
name: gen3
model: {data}/kinova_gen3/kinovaGen3V12.urdf
"""
_KINOVA_LOG = """\
log:
  time: {column: Time, factor: 0.001}
  q: "Position{i1}"
  qd: "Velocity{i1}"
  tau: "TorqueSm{i1}"
"""
ARMS = (
    Arm(
        "Panda, no hand",
        _PANDA,
        ("panda_ur10_rosbag2/panda_exciting_trajectory.db3",),
        0.55,
        _PANDA_LOG,
    ),
    Arm(
        "UR10, currents",
        _UR10,
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
KINOVA = Arm(
    "Kinova Gen3",
    _KINOVA,
    ("kinova_gen3/opti_traj_testing1.csv", "kinova_gen3/opti_traj_testing2.csv"),
    1.0,
    _KINOVA_LOG,
)
