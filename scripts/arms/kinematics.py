# SPDX-License-Identifier: Apache-2.0
"""The arm's numbers: where the joints are, their limits, what the links weigh. All are our own."""

from dataclasses import dataclass
from math import pi, radians


@dataclass(frozen=True)
class JointRow:
    """A joint of the tree; `xyz` [m] and `rpy` [rad] place the child in the parent."""

    name: str
    parent: str
    child: str
    xyz: tuple[float, float, float]
    axis: tuple[int, int, int] | None = None  # None: fixed
    limit: float = 0.0  # +- [rad]
    velocity: float = 0.0  # [rad/s]
    effort: float = 0.0  # [Nm]
    rpy: tuple[float, float, float] = (0.0, 0.0, 0.0)


Z, Y = (0, 0, 1), (0, 1, 0)
FOLD = radians(115)  # limit of the pitch joints
MOUNT = 0.024  # height of the plate that carries the base sensor

# distances along the stretched arm [m]
BASE_TO_ROLL_1 = 0.150
ROLL_1_TO_SHOULDER = 0.200
SHOULDER_TO_ROLL_3 = 0.250
ROLL_3_TO_ELBOW = 0.250
ELBOW_TO_ROLL_5 = 0.240
ROLL_5_TO_WRIST = 0.220
WRIST_TO_ROLL_7 = 0.110
ROLL_7_TO_FLANGE = 0.055
FLANGE_TO_TIP = 0.125
REACH = 1.250  # shoulder (axis 2) to the tool's tip, stretched; 1.125 to the flange

# roll radius, pitch radius, pitch half width (one side of the joint) [m]
R1, R3, R5, R7 = 0.082, 0.071, 0.060, 0.044
P2, P4, P6 = 0.086, 0.074, 0.061
W2, W4, W6 = 0.086, 0.074, 0.060

JOINTS = (
    JointRow("base_sensor", "base_mount", "link0", (0, 0, MOUNT)),
    JointRow("joint1", "link0", "link1", (0, 0, BASE_TO_ROLL_1), Z, radians(170), 2.6, 200.0),
    JointRow("joint2", "link1", "link2", (0, 0, ROLL_1_TO_SHOULDER), Y, FOLD, 2.6, 200.0),
    JointRow("joint3", "link2", "link3", (0, 0, SHOULDER_TO_ROLL_3), Z, radians(170), 2.8, 120.0),
    JointRow("joint4", "link3", "link4", (0, 0, ROLL_3_TO_ELBOW), Y, FOLD, 2.8, 120.0),
    JointRow("joint5", "link4", "link5", (0, 0, ELBOW_TO_ROLL_5), Z, radians(170), 3.6, 70.0),
    JointRow("joint6", "link5", "link6", (0, 0, ROLL_5_TO_WRIST), Y, FOLD, 3.6, 50.0),
    JointRow("joint7", "link6", "link7", (0, 0, WRIST_TO_ROLL_7), Z, radians(175), 3.6, 50.0),
    JointRow("wrist_sensor", "link7", "tool", (0, 0, ROLL_7_TO_FLANGE)),
    JointRow("handle_sensor", "link5", "handle", (0, -W6, ROLL_5_TO_WRIST), rpy=(pi / 2, 0, 0)),
)

# [kg]; 25.0 kg move up to the flange (links 1 to 7 and the handle), the tool adds 0.9 kg
MASSES = {
    "link0": 5.2,
    "link1": 5.3,
    "link2": 5.2,
    "link3": 4.3,
    "link4": 4.0,
    "link5": 2.8,
    "link6": 1.9,
    "link7": 1.05,
    "tool": 0.9,
    "handle": 0.45,
}
MOVING = ("link1", "link2", "link3", "link4", "link5", "link6", "link7", "handle")
