# SPDX-License-Identifier: Apache-2.0
"""A load that no arm carries is told of a description, with what would be allowed."""

import pytest

import touchline as tl
from touchline.model.plausibility import load_problem
from touchline.model.robot_file import write_description
from touchline.trials.arms import ARMS, described_arm


def loaded(tmp_path, mass, com):
    entry = {"link": "tool", "mass": mass, "com": com, "inertia": [0.0] * 6}
    out = tmp_path / "loaded.yaml"
    write_description(tl.load_robot("sara").description.path, out, {"loads": [entry]})
    return tl.load_robot(out)


@pytest.mark.parametrize(
    ("mass", "com", "words"),
    [
        (1e9, [0.0, 0.0, 0.05], "mass is 1e+09 kg, but at most 51.8 kg are allowed"),
        (1.0, [0.0, 0.0, 50.0], "com is 50 m from the origin of tool, but at most 1.5 m"),
    ],
)
def test_a_description_s_absurd_load_is_warned_of(tmp_path, mass, com, words):
    (line,) = loaded(tmp_path, mass, com).mechanism.warnings
    assert "loaded.yaml: loads[0] of link 'tool': " in line and words in line


def test_a_tool_is_no_absurd_load(tmp_path):
    assert loaded(tmp_path, 5.0, [0.0, 0.0, 0.3]).mechanism.warnings == ()


@pytest.mark.parametrize("name", ARMS)
def test_loads_that_arms_are_sold_with_are_none(name):
    robot = described_arm(name)
    for load in robot.description.loads:
        assert load_problem(load, robot.mechanism, robot.description.loads) is None
