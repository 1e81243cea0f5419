# SPDX-License-Identifier: Apache-2.0
"""One finite wrong signal that the others contradict is named and left out; touches are not."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.result.kinds import Fault
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run
from touchline.trials.cell import Cell
from touchline.trials.faults import FAULTS, channels_of, injected
from touchline.trials.recordings import record, robot_named
from touchline.trials.scene import arm_and_skin, make_pipeline, make_scene

BEGIN = 0.6  # s
RAMP = 40.0  # N/s: no step that a gate would see


@pytest.fixture(scope="module")
def arm():
    robot = tl.load_robot("sara-full")
    return robot, tl.Pipeline(robot), record(robot, 1, pushed=False, seconds=1.2).samples


def drifting(robot, samples, name):
    """A copy whose channel drifts from BEGIN on."""
    channel = next(c for c in channels_of(robot) if c.name == name)
    values = {k: getattr(samples, k).copy() for k in ("time", "q", "qd", "tau", "wrench")}
    copy = type(samples)(**values, row=0)
    channel.of(copy)[:] += RAMP * np.maximum(samples.time - BEGIN, 0.0)
    return copy


def heard(pipeline, s):
    pipeline.reset()
    before = len(pipeline.events)
    estimate, _ = pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)
    told = [f for f in pipeline.faults if f.fault != Fault.NONE]
    return estimate, told, pipeline.events[before:]


@pytest.mark.parametrize("name", ["wrist.fx", "wrist.fy", "handle.fz"])
def test_a_channel_that_wanders_is_named_and_never_a_collision(arm, name):
    robot, pipeline, samples = arm
    wrong = drifting(robot, samples, name)
    _, told, events = heard(pipeline, wrong)
    assert [f.channel for f in told][:1] == [name]
    assert told[0].fault == Fault.DISAGREES
    assert wrong.time[told[0].sample] - BEGIN < 0.2
    assert not [e for e in events if e.level == "collision"]


@pytest.mark.parametrize("name", ["wrist", "handle"])
def test_axes_that_are_swapped_are_named_and_never_a_collision(arm, name):
    robot, pipeline, samples = arm
    fault = next(f for f in FAULTS if f.name == "swapped axes")
    channel = next(c for c in channels_of(robot) if c.name == name)
    wrong, _ = injected(samples, fault, channel, BEGIN, np.random.default_rng(0))
    _, told, events = heard(pipeline, wrong)
    assert {f.channel for f in told} == {f"{name}.fx", f"{name}.fy"}
    assert not [e for e in events if e.level == "collision"]


@pytest.mark.parametrize("link", ["link3", "link5", "tool", "handle"])
def test_a_push_contradicts_nothing(arm, link):
    robot, pipeline, _ = arm
    profile = Profile(BEGIN, 0.3, 0.02, 0.02)
    push = ScriptedContact(
        link, np.array([0.03, 0.02, 0.05]), np.array([9.0, -20.0, 12.0]), profile
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    _, told, events = heard(pipeline, scripted(robot, [push], 1.2, 0.5, settings).samples)
    assert told == [] and len(events) >= 1


def test_many_samples_at_a_time_say_the_same_as_one_by_one(arm):
    robot, _, samples = arm
    s = drifting(robot, samples, "wrist.fx")
    whole, one = tl.Pipeline(robot), tl.Pipeline(robot)
    estimate, _ = whole.run(s.time, s.q, s.qd, s.tau, s.wrench)
    health, first = [], {}
    for i in range(len(s.time)):
        result = one.update(s.time[i], s.q[i], s.qd[i], s.tau[i], s.wrench[i])
        health.append(int(result.health))
        for fault in result.faults:
            first.setdefault(fault.channel, i)
    assert first == {f.channel: f.sample for f in whole.faults if f.fault != Fault.NONE} != {}
    np.testing.assert_array_equal(estimate.health, health)
    assert repr(one.events) == repr(whole.events)


def test_two_touches_that_cancel_in_one_axis_of_the_base_sensor_contradict_nothing():
    """Their forces are opposite: only a moment is left, which the joints between them feel too."""
    robot, skin = arm_and_skin("sara", 1)
    pipeline = make_pipeline(robot, skin)
    s = make_scene(Cell("sara", 2, 1, begin="apart"), 2).signals
    _, told, events = heard(pipeline, s)
    assert told == [] and events


@pytest.mark.parametrize("axis", [3, 4, 5])
def test_a_torque_of_the_base_sensor_that_nothing_else_feels_is_named(arm, axis):
    robot, pipeline, samples = arm
    name = f"base.m{'xyz'[axis - 3]}"
    _, told, events = heard(pipeline, drifting(robot, samples, name))
    assert [f.channel for f in told][:1] == [name]
    assert not [e for e in events if e.level == "collision"]


def test_a_joint_and_a_sensor_right_behind_it_differ_by_a_fault_and_no_contact():
    """Nothing lies between them: the torque is named, and no event begins."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = robot_named("ur5")
    pipeline = tl.Pipeline(robot)
    samples = record(robot, 1, pushed=False, seconds=1.2).samples
    wrong = drifting(robot, samples, "tau.shoulder_pan_joint")
    _, told, events = heard(pipeline, wrong)
    assert [f.channel for f in told][:1] == ["tau.shoulder_pan_joint"]
    assert told[0].fault == Fault.DISAGREES
    assert events == []


def test_during_a_touch_a_joint_and_the_sensor_behind_it_are_in_doubt_together():
    """The touch hides which of the two is wrong, so both are named; what measures else is not."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = robot_named("ur5")
    profile = Profile(0.4, 0.7, 0.02, 0.02)
    push = ScriptedContact(
        "forearm_link", np.array([0.0, 0.0, 0.2]), np.array([9.0, -20.0, 12.0]), profile
    )
    settings = Run(seed=3, noise=SensorNoise(), physics=2000.0)
    samples = scripted(robot, [push], 1.2, 0.5, settings).samples
    wrong = drifting(robot, samples, "tau.shoulder_pan_joint")
    _, told, _ = heard(tl.Pipeline(robot), wrong)
    assert {f.channel for f in told if f.fault == Fault.SUSPECT} == {
        "tau.shoulder_pan_joint",
        "base.mz",
    }


@pytest.fixture(scope="module")
def rubbing():
    """A UR5 whose joints rub with 1 Nm and 0.5 Nm s/rad; a sensor is right behind the last one."""
    robot = robot_named("ur5")
    samples = record(robot, 1, pushed=False, seconds=5.0).samples
    friction = np.tanh(samples.qd / 0.01) + 0.5 * samples.qd
    return robot, tl.Pipeline(robot), replace(samples, tau=samples.tau + friction)


def test_friction_of_a_joint_right_before_a_sensor_is_no_fault(rubbing):
    """The torque differs from the sensor for as long as the joint turns; it was called a fault."""
    _, pipeline, samples = rubbing
    assert heard(pipeline, samples)[1] == []


def test_a_torque_that_wanders_beside_friction_is_a_fault(rubbing):
    _, pipeline, samples = rubbing
    tau = samples.tau.copy()
    tau[:, 5] += 4.0 * np.clip(samples.time - 3.0, 0.0, 1.0)
    told = heard(pipeline, replace(samples, tau=tau))[1]
    assert told[0].channel == "tau.wrist_3_joint"
    assert 3.0 < samples.time[told[0].sample] < 5.0
