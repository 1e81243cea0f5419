# SPDX-License-Identifier: Apache-2.0
"""A sensor's frame is told apart from a payload, a bias and wrong inertias."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from touchline.identify.described import description_changes
from touchline.identify.evidence import gather
from touchline.identify.fit import Column, column_of
from touchline.identify.frame import FrameError, find_frames, frames_left, joined, with_frames
from touchline.model.robot import Robot
from touchline.model.transforms import rotation_rpy, rpy_of
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record

BASE, WRIST = 0, 1


@pytest.fixture(scope="module")
def robot():
    return load_arm("sara-full", 1)


def recorded(robot, real, seconds=20.0):
    """What an arm logs that carries 1 kg and more which its model lacks; 3 N of bias."""
    rng = np.random.default_rng(2)
    case = make_wrong_arm(robot, "payload alone", rng)
    description = replace(case.real.description, sensors=real.description.sensors)
    moved = replace(case, real=Robot(description, case.real.mechanism))
    moved = replace(moved, bias=np.array([3.0, *np.zeros(17)]))
    return record(moved, random_trajectory(robot, np.random.default_rng(1)), seconds, 200.0, rng)


def test_a_frame_that_is_right_is_left_alone(robot):
    assert find_frames(gather(robot, [[recorded(robot, robot)]])) == []


def test_a_turned_sensor_is_found_beside_a_payload(robot):
    sensors = list(robot.description.sensors)
    turned = tuple(np.radians([1.5, -1.0, 1.0]).tolist())
    sensors[WRIST] = replace(sensors[WRIST], rpy=turned)
    real = Robot(replace(robot.description, sensors=tuple(sensors)), robot.mechanism)
    samples = recorded(robot, real)
    found = find_frames(gather(robot, [[samples]]))
    assert [frame.name for frame in found] == ["wrist"]
    new = with_frames(robot, found)
    R = rotation_rpy(turned).T @ rotation_rpy(new.description.sensors[WRIST].rpy)
    assert np.degrees(np.arccos((np.trace(R) - 1.0) / 2.0)) < 0.1
    changes = description_changes(robot, new)["force_torque_sensors"]
    assert list(changes) == ["wrist"] and list(changes["wrist"]) == ["pose"]


def test_a_shift_is_told_of_a_sensor_that_is_hardly_turned(robot):
    """As in the second round, when the turn that was found first has been taken out."""
    sensors = list(robot.description.sensors)
    shift = 1e-3 * np.array([3.0, 4.0, 0.0])
    rpy = tuple(np.radians([0.02, -0.02, 0.02]).tolist())
    sensors[BASE] = replace(sensors[BASE], xyz=tuple(shift.tolist()), rpy=rpy)
    real = Robot(replace(robot.description, sensors=tuple(sensors)), robot.mechanism)
    (found,) = find_frames(gather(robot, [[recorded(robot, real, 40.0)]]))
    assert found.name == "base" and found.shift_error.all()
    assert (np.abs(found.shift - shift) < np.maximum(1e-3, 3.0 * found.shift_error)).all()
    assert np.degrees(np.linalg.norm(found.turn - rpy)) < 0.01  # so small that angles add


def test_what_is_left_of_a_frame_that_was_told_is_taken_out_however_little_it_is(robot):
    """Turns of two degrees are not small: the first round is off by more than noise explains."""
    sensors = list(robot.description.sensors)
    turned = tuple(np.radians([2.0, -1.5, 1.0]).tolist())
    sensors[WRIST] = replace(sensors[WRIST], rpy=turned)
    real = Robot(replace(robot.description, sensors=tuple(sensors)), robot.mechanism)
    samples = recorded(robot, real)
    first = find_frames(gather(robot, [[samples]]))
    once = with_frames(robot, first)
    evidence = gather(once, [[samples]])
    assert find_frames(evidence) == []  # nothing of it is sure
    (more,) = find_frames(evidence, first)
    twice = with_frames(once, [more])
    R = rotation_rpy(turned).T
    left = [
        np.arccos((np.trace(R @ rotation_rpy(r.description.sensors[WRIST].rpy)) - 1.0) / 2.0)
        for r in (once, twice)
    ]
    assert left[1] < left[0]


def test_frames_are_refined_by_what_the_model_leaves_of_each_row(robot):
    """The model errs less than `find_frames` takes for granted: the shift is known more closely."""
    sensors = list(robot.description.sensors)
    shift = 1e-3 * np.array([3.0, 4.0, 0.0])
    sensors[BASE] = replace(sensors[BASE], xyz=tuple(shift.tolist()))
    real = Robot(replace(robot.description, sensors=tuple(sensors)), robot.mechanism)
    samples = recorded(robot, real, 40.0)
    first = find_frames(gather(robot, [[samples]]))
    evidence = gather(with_frames(robot, first), [[samples]])
    (found,) = joined(first, frames_left(evidence, first))
    sigma = np.linalg.norm(found.shift_error)
    assert sigma < 0.5 * np.linalg.norm(first[0].shift_error)
    assert np.linalg.norm(found.shift - shift) < 3.0 * sigma
    sure = [replace(first[0], turn_error=1e-9 * np.ones(3), shift_error=1e-9 * np.ones(3))]
    (nothing,) = frames_left(evidence, sure)
    assert not nothing.turn.any() and not nothing.shift.any()
    assert frames_left(evidence, []) == []


def test_a_later_round_keeps_the_errors_of_what_it_does_not_tell():
    nothing, one, two = np.zeros(3), np.ones(3), np.full(3, 2.0)
    first = FrameError("base", one, 0.1 * one, two, 0.2 * one)
    (found,) = joined([first], [FrameError("base", one, 0.3 * one, nothing, nothing)])
    np.testing.assert_array_equal([found.turn, found.shift], [two, two])
    np.testing.assert_allclose([found.turn_error, found.shift_error], [0.3 * one, 0.2 * one])


@pytest.mark.parametrize("kind", ["turn", "shift"])
def test_columns_are_the_derivatives_of_the_residual(robot, kind):
    """By differences: a sensor that stands otherwise is described otherwise."""
    samples = recorded(robot, robot, 3.0)
    evidence, step = gather(robot, [[samples]]), 1e-5
    row = evidence.joints + 6 * WRIST
    for axis in range(3):
        away = np.eye(3)[axis] * step
        sensor = robot.description.sensors[WRIST]
        new = replace(sensor, **{"rpy" if kind == "turn" else "xyz": tuple(away.tolist())})
        sensors = tuple(new if s is sensor else s for s in robot.description.sensors)
        moved = Robot(replace(robot.description, sensors=sensors), robot.mechanism)
        slope = (gather(moved, [[samples]]).residual() - evidence.residual()) / step
        own = slope[:, row : row + 6]
        # The same in the axes of the described frame: the residual is turned and shifted back.
        left = evidence.residual()[:, row : row + 6].reshape(-1, 2, 3)
        e = np.eye(3)[axis]
        back = np.cross(e, left) if kind == "turn" else np.zeros_like(left)
        if kind == "shift":
            back[:, 1] = np.cross(e, left[:, 0])
        expected = own + back.reshape(-1, 6)
        column = Column(kind, row, axis=axis)
        found = np.stack([column_of(evidence, column, r) for r in column.rows], axis=1)
        np.testing.assert_allclose(found, expected, atol=1e-3 * np.abs(expected).max())


angles = st.floats(-1.5, 1.5)


@given(angles, angles, angles)
def test_roll_pitch_and_yaw_of_a_rotation(roll, pitch, yaw):
    rpy = [roll, pitch, yaw]
    np.testing.assert_allclose(rpy_of(rotation_rpy(rpy)), rpy, atol=1e-9)


@given(angles, st.sampled_from([-np.pi / 2, np.pi / 2]), angles)
def test_a_rotation_whose_roll_and_yaw_are_one(roll, pitch, yaw):
    R = rotation_rpy([roll, pitch, yaw])
    np.testing.assert_allclose(rotation_rpy(rpy_of(R)), R, atol=1e-7)
