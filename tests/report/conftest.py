# SPDX-License-Identifier: Apache-2.0
"""A recording in which the base is pushed, analyzed."""

import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.logs import write_table
from touchline.report.analysis import analyze


@pytest.fixture(scope="session")
def analysis(tmp_path_factory):
    robot = tl.load_robot("sara")
    samples = free_motion(robot, seconds=10.0, rate=200.0)
    samples = pushed(robot, samples, "link0", slice(800, 900), [20.0, 0.0, 0.0])
    folder = tmp_path_factory.mktemp("report")
    path = folder / "a <b> & c.parquet"
    write_table(path, samples, robot.description)
    return analyze(path, "sara", folder / "r")
