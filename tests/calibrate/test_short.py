# SPDX-License-Identifier: Apache-2.0
"""Thresholds from a recording that is too short to show a tail."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.calibrate.short import short_thresholds
from touchline.check.injected import make_case
from touchline.detector.thresholds import make_thresholds
from touchline.model.robot import Robot

PERIOD, SECONDS = 0.01, 20.0


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara")


@pytest.fixture(scope="module")
def samples(robot):
    return make_case(robot, (), np.random.default_rng(1)).samples


def contacts(robot, samples, growth=None):
    found = short_thresholds(robot, PERIOD, SECONDS, [[samples]], growth or {})
    detection = replace(robot.description.detection, method=("rows",), calibration=found)
    calibrated = Robot(replace(robot.description, detection=detection), robot.mechanism)
    thresholds = make_thresholds(calibrated, PERIOD)
    assert thresholds.calibrated
    return {row.joint: row.contact for row in thresholds.rows if row.joint >= 0}


def test_single_outliers_do_not_raise_thresholds(robot, samples):
    tau = samples.tau.copy()
    tau[500, 1] += 50.0
    clean, odd = contacts(robot, samples), contacts(robot, replace(samples, tau=tau))
    assert all(np.isfinite(value) and value > 0 for value in clean.values())
    assert odd[1] < 1.5 * clean[1]


def test_a_row_that_was_worse_on_other_data_has_a_higher_threshold(robot, samples):
    plain = contacts(robot, samples)
    grown = contacts(robot, samples, {robot.joint_names[2]: 2.0})
    assert grown[2] == pytest.approx(2.0 * plain[2], rel=1e-3)  # written with four digits
    assert grown[1] == pytest.approx(plain[1])
