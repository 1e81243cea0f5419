# SPDX-License-Identifier: Apache-2.0
"""One contact that is held stays one: how often noise alone makes it look like more."""

import numpy as np
import pytest

from touchline.trials.scene import FRICTION, arm_and_skin, make_pipeline
from touchline.trials.touches import TouchSampler, resting_signals

# Two-sided for the pitch of the wrench, one-sided for chi2, 4 sigma each (`pitch_limit`).
STATED = 6.3e-5 + 3.2e-5


@pytest.mark.parametrize(("arm", "tier"), [("panda", 2), ("sara", 2), ("ur10", 1)])
def test_a_held_contact_looks_like_several_as_often_as_is_said(arm, tier):
    robot, skin = arm_and_skin(arm, tier)
    looks = several = 0
    for run in range(8):
        touch = TouchSampler(skin, np.random.default_rng([7, run]), friction=FRICTION).sample(20.0)
        rng = np.random.default_rng([8, run])
        s = resting_signals(robot, touch.q, [(touch, 0.55)], 10.6, rng)
        pipeline = make_pipeline(robot, skin)
        pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
        table = pipeline.contacts
        held = table.sample > 600
        assert len(pipeline.events) == 1
        assert len(np.unique(table.sample[held])) == held.sum()  # never two places
        looks += int(held.sum())
        several += int((table.columns()["status"][held] == "not_separable").sum())
    assert looks == 8 * 9999
    # Samples nearer than 2 / K are not independent: alarms come in twos and threes.
    assert several < 3 * STATED * looks
