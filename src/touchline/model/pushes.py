# SPDX-License-Identifier: Apache-2.0
"""A robot that expects other pushes than its description says."""

from dataclasses import replace

from touchline.model.robot import Robot


def with_pushes(robot: Robot, friction: float | None, reach: float | None) -> Robot:
    """The robot, with what is given of its `pushes` replaced.

    Args:
        robot: the robot.
        friction: coefficient of friction of what touches, or None.
        reach: free space that a push needs [m], or None.
    """
    given = {"friction": friction, "reach": reach}
    known = {key: value for key, value in given.items() if value is not None}
    if not known:
        return robot
    pushes = replace(robot.description.pushes, **known)
    return Robot(replace(robot.description, pushes=pushes), robot.mechanism, robot.assumed)
