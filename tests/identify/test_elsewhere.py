# SPDX-License-Identifier: Apache-2.0
"""Recordings of few joints: what is written must not be worse where the arm has not been."""

from dataclasses import replace

import numpy as np

from touchline.identify.evidence import gather
from touchline.identify.identification import identify, rms
from touchline.identify.summary import identification_lines
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import imperfect, random_trajectory
from touchline.trials.wrong_arm import WrongArm, record

RATE, SECONDS = 100.0, 40.0


def test_what_one_joint_shows_does_little_harm_elsewhere():
    """A payload beside offsets once explained it, and was 14 Nm off where 0.3 Nm had been."""
    robot, rng = described_arm("panda-torques"), np.random.default_rng(1)
    real = Robot(robot.description, perturbed(robot.mechanism, 0.015, rng))
    arm = WrongArm(robot, real, 0, np.zeros(0), {}, {})
    whole, moving = random_trajectory(robot, rng), int(rng.integers(len(robot.joint_names)))
    motion = random_trajectory(robot, rng)
    amplitude = np.zeros_like(motion.amplitude)
    own = motion.amplitude * np.minimum(1.0, 1.0 / motion.amplitude.sum(axis=0))
    slower = min(1.0, 1.0 / (own * motion.frequency).sum(axis=0).max())
    amplitude[:, moving] = own[:, moving]
    few = replace(motion, amplitude=amplitude, frequency=slower * motion.frequency)
    one, other = (gather(robot, [[record(arm, m, SECONDS, RATE, rng)]]) for m in (few, whole))
    found = identify(one)
    before, after = (float(rms(x).sum()) for x in (other.residual(), found.left(other)))
    assert after < 2.0 * before
    assert found.withheld
    assert any("do not vouch" in line for line in identification_lines(found))


def test_motion_of_all_joints_vouches_for_inertias():
    robot, rng = described_arm("panda-torques"), np.random.default_rng(1)
    arm = WrongArm(robot, imperfect(robot, 0.015, 1), 0, np.zeros(0), {}, {})
    found = identify(
        gather(robot, [[record(arm, random_trajectory(robot, rng), SECONDS, RATE, rng)]])
    )
    assert not found.withheld and found.problem.bodies
