# SPDX-License-Identifier: Apache-2.0
"""A touch that never ends looks like an offset: large offsets are told to be perhaps one."""

import numpy as np
import pytest
from free_motion import pushed

from touchline.calibrate.lasting import lasting_lines
from touchline.identify.evidence import gather
from touchline.identify.identification import identify
from touchline.trials.arms import described_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record


def told(robot, samples):
    return lasting_lines(identify(gather(robot, [[samples]])))


@pytest.mark.parametrize("seed", [1, 2])
def test_a_hand_that_rests_on_the_arm_throughout_is_thought_of(seed):
    robot, rng = described_arm("panda-torques"), np.random.default_rng(seed)
    arm = make_wrong_arm(robot, "friction", rng)
    free = record(arm, random_trajectory(robot, rng), 30.0, 100.0, rng)
    assert told(robot, free) == []
    link = [node.links[0] for node in robot.nodes if node.links][-1]
    (line,) = told(robot, pushed(robot, free, link, slice(None), [0.0, 0.0, -15.0]))
    assert "panda_joint" in line and "a touch or a load" in line and "look the same" in line
