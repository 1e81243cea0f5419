# SPDX-License-Identifier: Apache-2.0
"""The robot without some of its force-torque sensors, for when they are lost."""

from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations
from weakref import ref

from touchline.arrays import Array
from touchline.detector.model_drift import link_errors
from touchline.detector.thresholds import (
    RowThreshold,
    Thresholds,
    expect_drift,
    make_thresholds,
)
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.native_robot import Weights, native_robot

SETS = 3  # sensors, of which any set may be lost: seven pipelines of 9 ms each
KEPT = 4  # robots whose stand-ins are kept for the next pipelines on them

# As asked for, surfaces (whose places in memory are part of that), and what was made.
_kept: deque[tuple[tuple[object, ...], object, list[core.StandIn]]] = deque(maxlen=KEPT)


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


def losses(sensors: int) -> list[tuple[int, ...]]:
    """The sets of sensors (indices) that a robot carries on without: what is made beforehand.

    Up to `SETS` sensors: any of them. With more, each alone, and all: who loses two does without
    all of them.
    """
    some = range(1, sensors + 1) if sensors <= SETS else sorted({1, sensors})
    return [lost for count in some for lost in combinations(range(sensors), count)]


class StandIns:
    """Makes what stands in for lost sensors.

    Args:
        robot: whole.
        thresholds: of the whole robot.
        skin: its surfaces.
        model_error: as of `Pipeline`.
        weights: what `native_robot` takes after the surfaces.
    """

    def __init__(
        self,
        robot: Robot,
        thresholds: Thresholds,
        skin: Skin,
        model_error: float,
        weights: Weights,
    ) -> None:
        self._robot, self._thresholds, self._skin = robot, thresholds, skin
        self._model_error, self._weights = model_error, weights

    def all(self) -> list[core.StandIn]:
        """Of all losses after which something is left that feels.

        Pipelines on one robot have the same ones, of which the core takes copies.
        """
        sets = losses(len(self._robot.sensor_names))
        asked = self._asked(sets)
        for before, _, made in tuple(_kept):
            if before == asked:
                return made
        found = [self.after(lost) for lost in sets]
        made = [stand_in for stand_in in found if stand_in is not None]
        _kept.appendleft((asked, self._skin.patches, made))
        return made

    def _asked(self, sets: Sequence[tuple[int, ...]]) -> tuple[object, ...]:
        """All that they follow from. Robots and surfaces never change: objects are compared.

        Of the thresholds only counts what each row tests.
        """
        rows = [(row.segment, row.component, row.joint) for row in self._thresholds.rows]
        patches = [id(patch) for patch in self._skin.patches]
        return ref(self._robot), patches, rows, self._model_error, self._weights, sets

    def after(self, lost: Sequence[int]) -> core.StandIn | None:
        """Of lost sensors (indices); None where nothing that is left feels anything."""
        robot, rest = self._robot, robot_without(self._robot, lost)
        measured = any(joint.measured for joint in rest.description.joints)
        if not rest.sensor_names and not measured:
            return None
        rough = make_thresholds(rest, self._weights[0])
        own = expect_drift(rest, rough, self._model_error, self._drift)
        skin = self._skin.on(rest)
        segments = [_segment_in(robot, rest, name, lost) for name in rest.segment_names]
        at = {_key(robot, row): i for i, row in enumerate(self._thresholds.rows)}
        rows = [at.get(_key(rest, row), -1) for row in own.rows]
        sensors = [robot.sensor_names.index(name) for name in rest.sensor_names]
        watch = [_watch(robot, rest, own, skin, name) for name in robot.segment_names]
        native = native_robot(rest, own, skin, *self._weights)
        return core.StandIn(list(lost), native, sensors, segments, rows, watch)

    def _drift(self, rest: Robot, error: float) -> tuple[Array, Array]:
        """As `guess_drift`: links that are off are the same whatever sensors there are."""
        parts: dict[str, list[str]] = {name: [] for name in rest.segment_names}
        for body in self._robot.bodies:
            part = parts.get(rest.body_of(body.links[0]).segment, [])
            if body.segment in self._robot.segment_names and body.segment not in part:
                part.append(body.segment)
        return link_errors(self._robot, error).drift(rest, parts)


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
