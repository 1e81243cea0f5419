# SPDX-License-Identifier: Apache-2.0
"""Delays are told apart from friction, offsets and wrong inertias."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

import touchline as tl
from touchline.calibrate.plan import make_plan
from touchline.check import injected
from touchline.identify.delay import Delay, find_delays, refined, with_delays
from touchline.identify.evidence import gather
from touchline.trials.arms import load_arm
from touchline.trials.free_motion import random_trajectory
from touchline.trials.wrong_arm import make_wrong_arm, record


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def samples(robot):
    """A minute at 200 Hz of an arm whose inertias are 1.5 % off, with friction and an offset."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(injected, "SECONDS", 60.0)
        patch.setattr(injected, "RATE", 200.0)
        found = injected.make_case(robot, (), np.random.default_rng(3)).samples
    tau = found.tau + 2.0 * np.tanh(found.qd / 0.05) + 1.0 * found.qd + 0.5
    return replace(found, tau=tau)


def test_what_comes_in_time_has_no_delay(robot, samples):
    assert find_delays(gather(robot, [[samples]])) == []


def test_late_torques_are_found_to_a_fifth_of_a_millisecond(robot, samples):
    tau = samples.tau.copy()
    tau[1:] = samples.tau[:-1]
    (found,) = find_delays(gather(robot, [[replace(samples, tau=tau)]]))
    assert found.name == "torques" and abs(found.value - 0.005) < 2e-4
    joints = with_delays(robot, [found]).description.joints
    assert all(joint.delay == pytest.approx(found.value, abs=1e-6) for joint in joints)


def test_a_late_sensor_is_found_by_itself(robot, samples):
    wrench = samples.wrench.copy()
    wrench[2:, 0] = samples.wrench[:-2, 0]
    (found,) = find_delays(gather(robot, [[replace(samples, wrench=wrench)]]))
    assert found.name == "base" and abs(found.value - 0.010) < 4e-4
    base, *others = with_delays(robot, [found]).description.sensors
    assert base.delay == pytest.approx(found.value, abs=1e-6)
    assert all(sensor.delay == 0.0 for sensor in others)


def test_what_is_left_of_a_delay_is_found_as_closely(robot, samples):
    wrench, time = samples.wrench.copy(), samples.time
    for axis in range(6):  # of 10 ms, of which 9.4 were found
        wrench[:, 0, axis] = np.interp(time - 6e-4, time, samples.wrench[:, 0, axis])
    found = [Delay("base", 0.0094, 1e-4), Delay("wrist", -0.002, 1e-4)]
    base, wrist = refined(found, gather(robot, [[replace(samples, wrench=wrench)]]))
    assert base.value == pytest.approx(0.010, abs=5e-5)
    assert wrist == found[1]


def test_a_late_base_is_known_as_closely_as_its_noise_allows():
    """It reads some 200 N: a model that errs by 0.2 % of that would tell a tenth as much."""
    robot, rng = load_arm("sara-full", 1), np.random.default_rng(5)
    case = replace(make_wrong_arm(robot, "payload alone", rng), late={"base": 6e-4})
    samples = record(case, random_trajectory(robot, rng), 40.0, 200.0, rng)
    first = [Delay("base", 0.0044, 6e-5)]  # what is left of 5 ms
    (found,) = refined(first, gather(robot, [[samples]]))
    assert found.error < 2e-5
    assert abs(found.value - 0.005) < 4.0 * found.error


def test_delays_add_to_those_of_the_description(robot):
    once = with_delays(robot, [Delay("wrist", 0.003, 1e-4)])
    (twice,) = [
        s
        for s in with_delays(once, [Delay("wrist", 0.002, 1e-4)]).description.sensors
        if s.name == "wrist"
    ]
    assert twice.delay == pytest.approx(0.005)


def test_torques_that_come_before_the_positions_leave_a_description_that_can_be_read(robot):
    early = with_delays(robot, [Delay("torques", -0.001, 1e-4), Delay("wrist", -0.001, 1e-4)])
    parts = (*early.description.joints, *early.description.sensors)
    assert {part.delay for part in parts} == {0.0}


def test_a_turned_sensor_is_not_late():
    """A Panda on a sensor that is 2 degrees and 5 mm off: its planned motion told 4 ms before."""
    robot = load_arm("panda", 1)
    plan, rng = make_plan(robot), np.random.default_rng((6, 1, 1))
    case, curve = make_wrong_arm(robot, "frame", rng), CubicSpline(plan.time, plan.q)

    def motion(time):
        return curve(time), curve(time, 1), curve(time, 2)

    found = record(case, motion, float(plan.time[-1]), 200.0, rng)
    evidence = gather(robot, [[found.where(np.arange(0, len(found), 4))]])
    assert find_delays(evidence) == []
