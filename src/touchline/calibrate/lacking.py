# SPDX-License-Identifier: Apache-2.0
"""Signals of joints that hold no numbers: which they are, and what to do about them."""

from collections.abc import Sequence

import numpy as np

from touchline.arrays import Index
from touchline.logs.naming import parse_naming
from touchline.logs.presence import Presence
from touchline.model.description import RobotDescription
from touchline.suggest import listing

MOST_LACKING = 0.5  # of the samples: where more lack a value, that is told first
NAMED = 3  # joints that are told one by one
WORDS = {"q": "position", "qd": "velocity", "tau": "torque"}
ADVICE = {
    "q": "positions that are missing: record them, or name their columns under `log: q`",
    "qd": "velocities that are missing: name their columns under `log: qd`, or take these columns "
    "out of the log: they are estimated from the positions then",
    "tau": "record it, name its column under `log: tau`, or describe the joint with torque: none",
}


def joints_lacking(robot: RobotDescription, present: Presence, signal: str) -> Index:
    """Joints whose `q`, `qd` or `tau` is no number in most of the samples."""
    most = present.lacking[signal] > MOST_LACKING * present.samples
    if signal == "tau":
        most &= np.array([joint.measured for joint in robot.joints], dtype=bool)
    return most.nonzero()[0]


def signal_words(
    robot: RobotDescription, signal: str, joints: Index, columns: Sequence[str]
) -> str:
    """The signals of some joints, with their columns in a table.

    Args:
        robot: whose joints they are.
        signal: "q", "qd" or "tau".
        joints: their numbers.
        columns: of the table; none of a rosbag2.
    """
    naming = parse_naming(robot)
    names = listing([robot.joints[j].name for j in joints], NAMED)
    told = f"{WORDS[signal]} of {names}"
    if len(joints) == len(robot.joints) > 1:
        told = f"{WORDS[signal]} of all {len(joints)} joints"
    own = [naming.joints[signal][j].name for j in joints]
    if set(own) <= set(columns):
        told += f" (column{'s' * (len(own) > 1)} {listing(own, NAMED)} of `log: {signal}`)"
    return told


def uncalibrated_words(
    robot: RobotDescription, present: Presence, columns: Sequence[str]
) -> str | None:
    """What is said of torques without values; None where all have some."""
    joints = joints_lacking(robot, present, "tau")
    if not len(joints):
        return None
    missing = int(present.lacking["tau"][joints].min())
    return (
        f"{signal_words(robot, 'tau', joints, columns)} is not a number in {missing} of "
        f"{present.samples} samples: not calibrated; {ADVICE['tau']}"
    )
