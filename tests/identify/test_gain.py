# SPDX-License-Identifier: Apache-2.0
"""Gains of motor currents are told apart from friction and inexact links; a load is no gain."""

from dataclasses import replace

import numpy as np
import pytest

from touchline.calibrate.run import calibrate
from touchline.errors import InputError
from touchline.identify.evidence import gather
from touchline.identify.fit import Column, column_of
from touchline.identify.gain import Gain, find_gains, multiplied, with_gains
from touchline.model.description import Friction
from touchline.model.robot import Robot
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record

GAINS = np.array([1.0, 0.75, 1.3, 1.0, 1.0, 1.0])


@pytest.fixture(scope="module")
def robot():
    return load_arm("ur10-currents", 1)


def with_true_gains(robot, gains):
    joints = robot.description.joints
    off = [replace(j, gain=float(g)) for j, g in zip(joints, gains, strict=True)]
    return Robot(replace(robot.description, joints=tuple(off)), robot.mechanism)


def recorded(robot, gains, kind="gain", seconds=30.0):
    """Currents of an arm whose links are 1.5 % off, with 3 Nm of friction in each joint."""
    rng = np.random.default_rng(3)
    case = make_wrong_arm(robot, kind, rng)
    real = Robot(with_true_gains(robot, gains).description, case.real.mechanism)
    friction = {j: Friction(3.0, 0.0, 0.02) for j in range(6)}
    case = replace(case, real=real, friction=friction)
    return record(case, random_trajectory(robot, rng), seconds, 200.0, rng)


def test_gains_that_are_right_are_left_alone(robot):
    assert find_gains(gather(robot, [[recorded(robot, np.ones(6))]])) == []


def test_gains_that_are_off_are_found_beside_friction(robot):
    samples = recorded(robot, GAINS)
    found = find_gains(gather(robot, [[samples]]))
    assert {"shoulder_lift_joint", "elbow_joint"} <= {gain.name for gain in found}
    mended = with_gains(robot, found)
    again = multiplied(found, find_gains(gather(mended, [[samples]])))
    for gain in again:
        true = GAINS[robot.joint_names.index(gain.name)]
        assert gain.factor == pytest.approx(true, abs=max(0.03 * true, 3.0 * gain.error))


def test_a_load_that_the_description_lacks_is_not_written_as_a_gain(robot):
    """A wrist that carries little by itself reads many times as much: no gain is that far off."""
    found = find_gains(gather(robot, [[recorded(robot, np.ones(6), "payload alone")]]))
    wrists = [gain for gain in found if gain.name.startswith("wrist")]
    assert not any(gain.plausible for gain in wrists)
    assert [j.gain for j in with_gains(robot, wrists).description.joints] == [1.0] * 6


def test_torques_of_the_links_have_no_gain_to_be_found():
    panda = load_arm("panda-torques", 1)
    case = make_wrong_arm(panda, "payload alone", np.random.default_rng(0))
    rng = np.random.default_rng(1)
    samples = record(case, random_trajectory(panda, rng), 5.0, 200.0, rng)
    assert find_gains(gather(panda, [[samples]])) == []


def test_the_column_is_what_the_described_masses_load_a_joint_with(robot):
    """By difference: twice the masses are twice the load."""
    evidence = gather(robot, [[recorded(robot, np.ones(6), seconds=3.0)]])
    for j in range(6):
        column = column_of(evidence, Column("gain", j), j)
        np.testing.assert_allclose(column, evidence.residual()[:, j] + evidence.reading[:, j])


def test_factors_of_two_rounds_are_multiplied():
    first, second = Gain("elbow", 0.8, 0.02), Gain("elbow", 1.05, 0.01)
    (both,) = multiplied([first], [second])
    assert both.factor == pytest.approx(0.84) and both.error == pytest.approx(0.008)
    assert multiplied([Gain("elbow", 0.1, 0.02)], [second]) == [second]


def test_what_cannot_be_asked_for_is_said(tmp_path):
    log = tmp_path / "log.csv"
    log.write_text("time\n0\n")
    with pytest.raises(InputError, match="--gains: sara has no joint with torque: motor"):
        calibrate([log], "sara", tmp_path / "out.yaml", gains=True)
    with pytest.raises(InputError, match="leave --no-identify out"):
        calibrate([log], "sara", tmp_path / "out.yaml", gains=True, identification=False)
