# SPDX-License-Identifier: Apache-2.0
"""Where the links are: forward kinematics of a mechanism, one state at a time."""

from collections.abc import Mapping

from touchline.model.mechanism import Array, Joint, Mechanism
from touchline.model.transforms import joint_motion, pose


def joint_position(joint: Joint, positions: Mapping[str, float]) -> float:
    """Return a joint's position [rad or m]; mimics follow, joints without a position are at 0."""
    if joint.mimic is None:
        return positions.get(joint.name, 0.0)
    return joint.mimic.multiplier * positions.get(joint.mimic.joint, 0.0) + joint.mimic.offset


def link_poses(mechanism: Mechanism, positions: Mapping[str, float]) -> dict[str, Array]:
    """Return the pose (4, 4) of each link in the root link's frame, which is the world.

    Args:
        mechanism: a tree, its joints in any order.
        positions: of independent joints, by name [rad or m]; 0 where there is none.
    """
    outboard: dict[str, list[Joint]] = {}
    for joint in mechanism.joints.values():
        outboard.setdefault(joint.parent, []).append(joint)
    poses = {mechanism.root: pose()}
    pending = [mechanism.root]
    while pending:
        link = pending.pop()
        for joint in outboard.get(link, ()):
            motion = joint_motion(joint.kind, joint.axis, joint_position(joint, positions))
            poses[joint.child] = poses[link] @ joint.T_parent_joint @ motion
            pending.append(joint.child)
    return poses
