# SPDX-License-Identifier: Apache-2.0
"""Sensors that stand or point a little otherwise than described.

A sensor's frame is off where its axes are turned against those of what it carries. Biases, a
payload and inertias are free beside it, for a body whose centre is off looks like a shifted sensor.
A frame is written only if that foretells parts of time which the fit has not seen. A shift is often
sure only in a second round, once the turn has been taken out. What was told is then refined: each
row counts by what the model leaves of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from touchline.arrays import Array
from touchline.identify.choice import FINE_SCATTER, Chooser
from touchline.identify.evidence import Evidence
from touchline.identify.fit import Column, Solution
from touchline.model.description import AXES
from touchline.model.robot import Robot
from touchline.model.transforms import rotation_about, rotation_rpy, rpy_of

SURE = 5.0  # standard errors
LEAST = {"turn": np.radians(0.1), "shift": 5e-4}  # rad, m; smaller ones are left alone
DIGITS = 6  # of a written figure: 1e-6 rad or m


@dataclass(frozen=True)
class FrameError:
    """How far a sensor's frame is off, in its described axes.

    Attributes:
        name: of the sensor.
        turn, turn_error: (3,) rotation vector with one standard error [rad]; zeros: not told.
        shift, shift_error: (3,) [m].
    """

    name: str
    turn: Array
    turn_error: Array
    shift: Array
    shift_error: Array


def find_frames(evidence: Evidence, before: Sequence[FrameError] = ()) -> list[FrameError]:
    """Frames that are off as far as the data are sure of it.

    Args:
        evidence: read with the frames found so far.
        before: these. What was told of them once is refined, however little is left of it.
    """
    sensors = _judged(evidence)
    if not sensors:
        return []
    chooser = Chooser(evidence, np.ones(len(evidence), dtype=bool))
    every, known = frame_columns(evidence), _told_columns(evidence, before)
    turns = tuple(c for c in every if c.kind == "turn")
    if not known and not _sure_columns(chooser.fit_beside(every)):
        return []
    options = [known, tuple(c for c in every if c in known or c in turns), every]
    found = chooser.choose_beside(list(dict.fromkeys(options)))
    while True:
        sure = _sure_columns(found)
        sure += [c for c in known if c not in sure]
        shifted = {c.row for c in sure if c.kind == "shift"}
        # What is left of a turn would be taken for a shift: it is free beside one, however small.
        kept = [c for c in _frame_columns(found) if c in sure or c.row in shifted]
        if kept == _frame_columns(found):
            break
        columns = tuple(c for c in found.problem.columns if c.kind not in LEAST or c in kept)
        found = chooser.with_errors(chooser.fit(replace(found.problem, columns=columns)))
    off = {c.row for c in _frame_columns(found)}
    return [_error_of(evidence, found, s) for s in sensors if evidence.joints + 6 * s in off]


def frames_left(evidence: Evidence, before: Sequence[FrameError]) -> list[FrameError]:
    """What is left of frames once each row counts by what the model leaves of it.

    Only what is surer than before is told; the rest is zero.

    Args:
        evidence: read with the frames found so far.
        before: these.
    """
    known = _told_columns(evidence, before)
    if not known:
        return []
    every = np.ones(len(evidence), dtype=bool)
    found = Chooser(evidence, every, FINE_SCATTER).choose_beside([known])
    names = evidence.robot.sensor_names
    return [_surer(_error_of(evidence, found, names.index(old.name)), old) for old in before]


def _surer(own: FrameError, old: FrameError) -> FrameError:
    """`own` without what `old` knows as surely."""
    nothing = np.zeros(3)
    if np.linalg.norm(own.turn_error) >= np.linalg.norm(old.turn_error):
        own = replace(own, turn=nothing, turn_error=nothing)
    if np.linalg.norm(own.shift_error) >= np.linalg.norm(old.shift_error):
        own = replace(own, shift=nothing, shift_error=nothing)
    return own


def frame_columns(evidence: Evidence) -> tuple[Column, ...]:
    """What sensors that are turned or shifted would do: the turns first, then the shifts."""
    first = [evidence.joints + 6 * s for s in _judged(evidence)]
    return tuple(Column(kind, row, axis=a) for kind in LEAST for row in first for a in range(3))


def with_frames(robot: Robot, frames: Sequence[FrameError]) -> Robot:
    """The robot whose sensors stand where they were found to."""
    off = {frame.name: frame for frame in frames}
    sensors = []
    for sensor in robot.description.sensors:
        if sensor.name in off:
            own, R = off[sensor.name], rotation_rpy(sensor.rpy)
            angle = float(np.linalg.norm(own.turn))
            turned = R @ rotation_about(own.turn / angle, angle) if angle else R
            xyz = np.array(sensor.xyz) + R @ own.shift
            sensor = replace(sensor, xyz=_rounded(xyz.tolist()), rpy=_rounded(rpy_of(turned)))
        sensors.append(sensor)
    return Robot(replace(robot.description, sensors=tuple(sensors)), robot.mechanism)


def joined(before: Sequence[FrameError], later: Sequence[FrameError]) -> list[FrameError]:
    """What was found in two rounds; the errors are those of the later one that tells it."""
    found = {frame.name: frame for frame in before}
    for own in later:
        old = found.get(own.name)
        if old is not None:
            own = FrameError(
                own.name,
                old.turn + own.turn,
                own.turn_error if own.turn_error.any() else old.turn_error,
                old.shift + own.shift,
                own.shift_error if own.shift_error.any() else old.shift_error,
            )
        found[own.name] = own
    return list(found.values())


def _judged(evidence: Evidence) -> list[int]:
    """Sensors of all axes whose log is in their own frame, with the weight in it."""
    n = evidence.joints
    return [
        s
        for s, sensor in enumerate(evidence.robot.description.sensors)
        if len(sensor.axes) == len(AXES)
        and sensor.frame == "sensor"
        and sensor.compensated == "none"
        and evidence.used[n + 6 * s : n + 6 * s + 6].all()
    ]


def _told_columns(evidence: Evidence, frames: Sequence[FrameError]) -> tuple[Column, ...]:
    """The columns of what has been told of frames."""
    told = {
        (kind, evidence.joints + 6 * s)
        for s in _judged(evidence)
        for frame in frames
        for kind, error in (("turn", frame.turn_error), ("shift", frame.shift_error))
        if frame.name == evidence.robot.sensor_names[s] and error.any()
    }
    return tuple(c for c in frame_columns(evidence) if (c.kind, c.row) in told)


def _of(found: Solution, kind: str, s: int, evidence: Evidence) -> tuple[Array, Array]:
    """Values and errors (3,) of a sensor; zeros where they were not free."""
    row = evidence.joints + 6 * s
    values, errors = np.zeros(3), np.zeros(3)
    for column, value, error in zip(found.problem.columns, found.values, found.errors, strict=True):
        if (column.kind, column.row) == (kind, row):
            values[column.axis], errors[column.axis] = value, error
    return values, errors


def _frame_columns(found: Solution) -> list[Column]:
    return [c for c in found.problem.columns if c.kind in LEAST]


def _sure_columns(found: Solution) -> list[Column]:
    return [c for c in _frame_columns(found) if _sure(found, c)]


def _sure(found: Solution, column: Column) -> bool:
    """Is any axis of the sensor's frame off by more than chance and more than matters?"""
    own = [
        (value, error)
        for c, value, error in zip(found.problem.columns, found.values, found.errors, strict=True)
        if (c.kind, c.row) == (column.kind, column.row)
    ]
    return any(abs(v) > max(SURE * e, LEAST[column.kind]) for v, e in own)


def _error_of(evidence: Evidence, found: Solution, s: int) -> FrameError:
    name = evidence.robot.sensor_names[s]
    turn, turn_error = _of(found, "turn", s, evidence)
    shift, shift_error = _of(found, "shift", s, evidence)
    return FrameError(name, turn, turn_error, shift, shift_error)


def _rounded(values: Sequence[float]) -> tuple[float, ...]:
    return tuple(round(float(x), DIGITS) + 0.0 for x in values)
