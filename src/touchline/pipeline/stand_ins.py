# SPDX-License-Identifier: Apache-2.0
"""The robot without some of its force-torque sensors, for when they are lost."""

from collections.abc import Callable, Sequence
from dataclasses import replace

from touchline.detector.thresholds import RowThreshold, Thresholds
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.native import core


def robot_without(robot: Robot, lost: Sequence[int]) -> Robot:
    """The robot as if it had never had these sensors (indices); joints read from them have none."""
    names = {robot.sensor_names[s] for s in lost}
    description = robot.description
    sensors = tuple(s for s in description.sensors if s.name not in names)
    joints = tuple(
        replace(joint, torque="none", sources=()) if names & set(joint.sources) else joint
        for joint in description.joints
    )
    return Robot(replace(description, sensors=sensors, joints=joints), robot.mechanism)


def stand_in(
    robot: Robot,
    thresholds: Thresholds,
    lost: Sequence[int],
    make: Callable[[Robot], tuple[core.Robot, Thresholds, Skin]],
) -> core.StandIn | None:
    """What stands in for lost sensors; None where nothing that is left feels anything.

    Args:
        robot: whole.
        thresholds: of the whole robot.
        lost: indices of its lost sensors.
        make: of the robot without them, all that a native pipeline needs.
    """
    rest = robot_without(robot, lost)
    measured = any(joint.measured for joint in rest.description.joints)
    if not rest.sensor_names and not measured:
        return None
    native, own, skin = make(rest)
    segments = [_segment_in(robot, rest, name, lost) for name in rest.segment_names]
    at = {_key(robot, row): i for i, row in enumerate(thresholds.rows)}
    rows = [at.get(_key(rest, row), -1) for row in own.rows]
    sensors = [robot.sensor_names.index(name) for name in rest.sensor_names]
    watch = [_watch(robot, rest, own, skin, name) for name in robot.segment_names]
    return core.StandIn(list(lost), native, sensors, segments, rows, watch)


def _key(robot: Robot, row: RowThreshold) -> tuple[str, int]:
    """What a row of the detector tests: a joint's torque or a component of a segment's wrench."""
    if row.component < 0:
        return robot.joint_names[row.joint], -1
    return robot.segment_names[row.segment], row.component


def _segment_in(robot: Robot, rest: Robot, name: str, lost: Sequence[int]) -> int:
    """The segment of the whole robot that a segment of the rest is told as."""
    if name in robot.segment_names:
        return robot.segment_names.index(name)
    # The rest's root: told as the segment of the lost sensor that is nearest to the root.
    first = min(lost, key=lambda s: _depth(robot, robot.sensor_names[s]))
    return robot.segment_names.index(robot.sensor_names[first])


def _depth(robot: Robot, sensor: str) -> int:
    return next(i for i, node in enumerate(robot.nodes) if node.sensor == sensor)


def _watch(robot: Robot, rest: Robot, own: Thresholds, skin: Skin, segment: str) -> core.Watch:
    """Whether a touch of a segment of the whole robot is still felt."""
    alone = segment in rest.segment_names and (
        segment == "root" or set(robot.successors(segment)) == set(rest.successors(segment))
    )
    if alone:
        return core.Watch.watched
    tested = {rest.segment_names[row.segment] for row in own.rows}
    links = {link for body in robot.bodies if body.segment == segment for link in body.links}
    felt = {patch.segment for patch in skin.patches if patch.link in links}
    return core.Watch.degraded if felt & tested else core.Watch.blind
