# SPDX-License-Identifier: Apache-2.0
"""Identification of real arms, judged on recordings that played no part."""

import pytest

from touchline.bench.identify.arms import ARMS
from touchline.bench.identify.run import judge, tool_masses


@pytest.mark.parametrize("arm", ARMS, ids=[arm.name for arm in ARMS])
def test_the_rest_of_a_recording_leaves_less_over_in_every_joint(arm, data):
    result = judge(arm, data)
    assert result.share <= arm.limit
    assert (result.after <= result.before).all()


def test_two_recordings_agree_in_the_mass_of_a_tool(data):
    (first, error), (second, other) = tool_masses(data)
    assert abs(first - second) <= 0.05
    assert 0.4 < first < 0.8
    assert 0.0 < error < 0.1 and 0.0 < other < 0.2
    assert abs(first - second) <= 2.0 * (error**2 + other**2) ** 0.5
