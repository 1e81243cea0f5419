# SPDX-License-Identifier: Apache-2.0
"""A channel reports what cannot be: told by name in the same sample, and no contact follows."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import exact_loads
from test_lost_sensors import robot_named

import touchline as tl
from touchline.model.description import Friction
from touchline.model.robot import Robot
from touchline.observer.samples import Samples

RATE = 1000.0
SECONDS = 1.2
AT = 700  # sample at which the fault begins
# rad, rad/s, Nm, N, Nm
SPIKES = {"q": 3.0, "qd": 2.0, "tau": 80.0, "force": 300.0, "moment": 300.0}
NAMES = ("sara", "sara-full", "ur5")
AXES = ("fx", "fy", "fz", "mx", "my", "mz")
_motions = {}


def in_motion(name, seed=0, rate=RATE, swing=0.3):
    """The arm swings [rad], nothing touches it, and its sensors are noisy; its model is 2 % off."""
    key = name, seed, rate, swing
    if key not in _motions:
        robot = robot_named(name)
        rng = np.random.default_rng(seed)
        n = len(robot.joint_names)
        time = np.arange(round(SECONDS * rate)) / rate
        phase, pace = rng.uniform(0.0, 2 * np.pi, n), rng.uniform(1.0, 3.0, n)
        q = 0.6 + swing * np.sin(np.outer(time, pace) + phase)
        qd = swing * pace * np.cos(np.outer(time, pace) + phase)
        tau, wrench = exact_loads(robot, time, q, qd)
        tau, wrench = 1.005 * tau, 1.005 * wrench
        noise = rng.normal(0.0, 1.0, (len(time), 3 * n + 6 * len(robot.sensor_names)))
        q = q + 3e-6 * noise[:, :n]
        qd = qd + 2e-4 * noise[:, n : 2 * n]
        tau = tau + 0.05 * noise[:, 2 * n : 3 * n]
        scale = np.tile([0.05] * 3 + [0.01] * 3, len(robot.sensor_names))
        wrench = wrench + (scale * noise[:, 3 * n :]).reshape(wrench.shape)
        _motions[key] = Samples(time, q, qd, tau, wrench)
    s = _motions[key]
    return Samples(s.time, s.q.copy(), s.qd.copy(), s.tau.copy(), s.wrench.copy())


def channels(robot):
    """Name, signal and place of each measured channel."""
    joints = robot.description.joints
    for j, name in enumerate(robot.joint_names):
        yield f"q.{name}", "q", (j,)
        yield f"qd.{name}", "qd", (j,)
        if joints[j].measured:
            yield f"tau.{name}", "tau", (j,)
    for s, name in enumerate(robot.sensor_names):
        for i, axis in enumerate(AXES):
            yield f"{name}.{axis}", "wrench", (s, i)


def spike_of(signal, place):
    return SPIKES["force" if place[1] < 3 else "moment"] if signal == "wrench" else SPIKES[signal]


def run(pipeline, s):
    return pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_spike_of_any_channel_is_told_at_once_by_name_and_begins_nothing(name, sign):
    robot = robot_named(name)
    pipeline = tl.Pipeline(robot)
    for channel, signal, place in channels(robot):
        s = in_motion(name)
        getattr(s, signal)[(AT, *place)] += sign * spike_of(signal, place)
        pipeline.reset()
        before = len(pipeline.events)
        estimate, _ = run(pipeline, s)
        assert [(c.sample, c.channel, str(c.fault)) for c in pipeline.faults] == [
            (AT, channel, "spike"),
            (AT + 1, channel, "none"),
        ]
        assert pipeline.events[before:] == []
        told = np.flatnonzero(estimate.health & tl.Health.FAULTY)
        assert told.tolist() == [AT]


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("speed", [0.04, 0.048])
def test_a_velocity_of_a_slow_joint_that_turns_its_sign_is_held_and_no_collision(speed, seed):
    """The step is less than a tenth of a radian per second: only positions show that it is none."""
    robot = robot_named("ur5")
    pipeline = tl.Pipeline(robot)
    s = in_motion("ur5", seed=seed)
    joint = 0
    s.qd[:, joint] += speed - s.qd[AT, joint]  # at AT it is as fast as told
    s.q[:, joint] = s.q[0, joint] + np.cumsum(s.qd[:, joint]) / RATE
    s.q[:, joint] += 2e-6 * np.random.default_rng(seed).normal(size=len(s.time))
    tau, wrench = exact_loads(robot, s.time, s.q, s.qd)
    s = replace(s, tau=tau, wrench=wrench)
    s.qd[AT : AT + 300, joint] *= -1.0
    run(pipeline, s)
    first = pipeline.faults[0]
    assert (first.sample, first.channel, str(first.fault)) == (
        AT,
        "qd.shoulder_pan_joint",
        "spike",
    )
    assert [event for event in pipeline.events if event.level == "collision"] == []


@pytest.mark.parametrize("grain", [0.06, 0.1])
def test_a_velocity_that_flickers_by_its_last_digit_is_not_faulty(grain):
    """The arm stands: one sample in a hundred is rounded up, and no position shows that."""
    pipeline = tl.Pipeline(robot_named("sara"))
    s = in_motion("sara", swing=0.0)
    s.qd[:] = grain * (np.random.default_rng(0).random(s.qd.shape) < 0.01)
    run(pipeline, s)
    assert [c for c in pipeline.faults if c.channel.startswith("qd")] == []


def frozen(values, at):
    values[AT:] = values[at]


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", ["stuck", "zero"])
def test_a_stuck_or_dead_torque_or_wrench_is_told_within_50_ms(name, fault):
    robot = robot_named(name)
    pipeline = tl.Pipeline(robot)
    for channel, signal, place in channels(robot):
        if signal in ("q", "qd"):
            continue
        s = in_motion(name)
        values = getattr(s, signal)[(slice(None), *place)]
        values[AT:] = values[AT] if fault == "stuck" else 0.0
        pipeline.reset()
        before = len(pipeline.events)
        run(pipeline, s)
        first = pipeline.faults[0]
        assert first.channel == channel
        assert AT <= first.sample <= AT + 50
        last = {c.channel: c.fault for c in pipeline.faults}
        assert last == {channel: tl.Fault.STUCK}
        assert [e for e in pipeline.events[before:] if e.level == "collision"] == []


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("seed", range(3))
def test_healthy_motion_has_no_fault(name, seed):
    pipeline = tl.Pipeline(robot_named(name))
    estimate, _ = run(pipeline, in_motion(name, seed))
    assert pipeline.faults == ()
    assert not (estimate.health & tl.Health.FAULTY).any()


def test_updates_say_the_same_as_run_to_the_last_bit_whatever_is_faulty():
    robot = robot_named("ur5")
    s = in_motion("ur5")
    s.wrench[300, 1, 0] += 300.0
    s.tau[310:340, 2] = s.tau[310, 2]
    s.wrench[400:480, 0] = np.random.default_rng(0).normal(0.0, 300.0, (80, 6))
    s.qd[600, 1] += 2.0
    s.q[700:720, 1] += 3.0
    s.wrench[800:900, 1] = np.nan
    whole, parts, steps = (tl.Pipeline(robot) for _ in range(3))
    expected = run(whole, s)[0]
    faults = whole.faults
    assert {str(c.fault) for c in faults} >= {"spike", "wild", "stuck"}
    told, at = [], 0
    for end in (1, 7, 305, 309, 335, 402, 650, 705, 1000, len(s.time)):
        part = Samples(*(getattr(s, k)[at:end] for k in ("time", "q", "qd", "tau", "wrench")))
        rows = run(parts, part)[0]
        np.testing.assert_array_equal(rows.tau_ext, expected.tau_ext[at:end])
        np.testing.assert_array_equal(rows.segment_wrench, expected.segment_wrench[at:end])
        np.testing.assert_array_equal(rows.health, expected.health[at:end])
        at = end
    for i in range(len(s.time)):
        result = steps.update(s.time[i], s.q[i], s.qd[i], s.tau[i], s.wrench[i])
        np.testing.assert_array_equal(result.estimate.tau_ext, expected.tau_ext[i])
        np.testing.assert_array_equal(result.estimate.segment_wrench, expected.segment_wrench[i])
        assert result.health == expected.health[i]
        now = {(f.channel, f.fault) for f in result.faults}
        assert bool(now) == bool(result.health & tl.Health.FAULTY)
        told.append(now)
    for change in faults:
        if change.fault != tl.Fault.NONE:
            assert (change.channel, change.fault) in told[change.sample]


@pytest.mark.parametrize("rise", [0, 1, 2])
def test_a_blow_of_300_n_on_a_lone_sensor_is_taken_at_once(rise):
    """All axes of a sensor move as one force moves them: that is no fault, however steep it is."""
    robot = robot_named("sara")
    s = in_motion("sara")
    force = np.array([180.0, -150.0, 187.0])
    load = np.concatenate([force, np.cross([0.1, 0.25, -0.05], force)])
    share = np.clip((np.arange(len(s.time)) - AT + 1) / (rise + 1), 0.0, 1.0)
    s.wrench[:, 0] -= np.outer(share, load)  # the innermost one alone, as of a blow on its own link
    pipeline = tl.Pipeline(robot)
    run(pipeline, s)
    assert pipeline.faults == ()
    assert pipeline.events[0].detected <= s.time[AT] + 0.005


# N, Nm per sample as it begins: of forces of 700 N on links 1 and 3 of sara against each other.
CLAMP = 4.0 * np.array([1.0, -1.6, 2.1, -0.3, 3.8, -1.3])


def of_a_clamp():
    """Its rise and fall are a half sine of 70 ms, on the innermost sensor of sara alone."""
    s = in_motion("sara")
    wave = np.clip((np.arange(len(s.time)) - AT) / 70.0, 0.0, 1.0)
    s.wrench[:, 0] -= np.outer(70.0 / np.pi * np.sin(np.pi * wave), CLAMP)
    return s


def test_two_forces_against_each_other_on_a_lone_sensor_are_believed_within_five_samples():
    """Their wrench is that of no force, but several axes go on for many samples as they began."""
    s = of_a_clamp()
    pipeline = tl.Pipeline(robot_named("sara"))
    run(pipeline, s)
    assert {str(c.fault) for c in pipeline.faults} == {"spike", "none"}
    for channel in {c.channel for c in pipeline.faults}:
        told = [c for c in pipeline.faults if c.channel == channel]
        for begun, ended in zip(told[::2], told[1::2], strict=True):
            assert str(begun.fault) == "spike" and ended.sample - begun.sample <= 5
    (event,) = pipeline.events  # no collision: a sensor that dies begins like this
    assert event.detected <= s.time[AT] + 0.01


@pytest.mark.parametrize("axis", [2, 4])
def test_what_one_axis_makes_up_beside_a_blow_is_not_believed(axis):
    s = of_a_clamp()
    rng = np.random.default_rng(axis)
    s.wrench[AT : AT + 70, 0, axis] = rng.uniform(-300.0, 300.0, 70)
    pipeline = tl.Pipeline(robot_named("sara"))
    run(pipeline, s)
    name = f"base.{AXES[axis]}"
    told = [(c.sample, str(c.fault)) for c in pipeline.faults if c.channel == name]
    faulty = np.zeros(len(s.time), bool)
    for (begin, fault), (end, _) in zip(told, [*told[1:], (len(s.time), "")], strict=True):
        faulty[begin:end] = fault != "none"
    assert faulty[AT : AT + 70].mean() > 0.9


def test_a_new_level_of_one_axis_that_lives_is_taken_three_samples_late():
    s = in_motion("sara")
    s.wrench[AT:, 0, 2] += 100.0  # the innermost one
    pipeline = tl.Pipeline(robot_named("sara"))
    run(pipeline, s)
    told = [(c.sample, str(c.fault)) for c in pipeline.faults]
    assert told[:2] == [(AT, "spike"), (AT + 3, "none")]
    # Nothing else feels it: it is suspected, and no collision.
    assert [fault for _, fault in told[2:]] == ["suspect"] and told[2][0] < AT + 50
    assert [e.level for e in pipeline.events] == ["contact"]


def test_a_new_level_that_the_sensor_inboard_does_not_feel_is_left_out():
    """UR5 with two sensors: what loads a joint or the wrist loads the base."""
    pipeline = tl.Pipeline(robot_named("ur5"))
    for signal, place, jump in (("tau", (2,), 40.0), ("wrench", (1, 2), 100.0)):
        s = in_motion("ur5")
        getattr(s, signal)[(slice(AT, AT + 200), *place)] += jump
        pipeline.reset()
        before = len(pipeline.events)
        run(pipeline, s)
        said = [(str(c.fault), c.sample) for c in pipeline.faults]
        assert [kind for kind, _ in said] == ["spike", "step", "none"]
        assert said[0][1] == AT
        assert AT + 200 <= said[-1][1] <= AT + 205
        assert pipeline.events[before:] == []


@pytest.mark.parametrize("signal", ["tau", "wrench"])
def test_a_signal_that_is_clipped_at_an_unknown_rail_is_told(signal):
    s = in_motion("ur5")
    values = s.tau[:, 2] if signal == "tau" else s.wrench[:, 0, 4]
    rail = np.max(values[:AT]) + 1e-3
    values[AT:] = rail
    pipeline = tl.Pipeline(robot_named("ur5"))
    run(pipeline, s)
    assert pipeline.faults[0].sample <= AT + 10
    assert pipeline.faults[0].fault in (tl.Fault.STUCK, tl.Fault.SPIKE)


def test_readings_that_are_not_finite_are_no_step_when_they_end():
    s = in_motion("sara")
    s.wrench[AT : AT + 10, 0] = np.inf
    s.wrench[AT : AT + 10, 1, 2] = 1e12
    pipeline = tl.Pipeline(robot_named("sara"))
    run(pipeline, s)
    assert pipeline.faults == ()


def test_a_channel_that_has_gone_wild_is_left_out_and_comes_back():
    s = in_motion("ur5")
    s.wrench[AT : AT + 100, 1, 2] += np.random.default_rng(1).uniform(200.0, 900.0, 100)
    pipeline = tl.Pipeline(robot_named("ur5"))
    run(pipeline, s)
    kinds = [(str(c.fault), c.sample) for c in pipeline.faults]
    assert kinds[0] == ("spike", AT)
    assert [kind for kind, _ in kinds] == ["spike", "wild", "none"]
    assert kinds[1][1] <= AT + 5
    assert kinds[-1][0] == "none"
    assert AT + 90 <= kinds[-1][1] <= AT + 120
    assert [e for e in pipeline.events if e.level == "collision"] == []


def test_a_joint_that_passes_a_whole_turn_is_not_faulty():
    robot = robot_named("ur5")
    s = in_motion("ur5")
    wrapped = replace(s, q=s.q - 2 * np.pi * (np.arange(len(s.time)) >= AT)[:, None])
    pipeline = tl.Pipeline(robot)
    run(pipeline, wrapped)
    assert pipeline.faults == ()


def test_samples_that_come_twice_are_not_stuck():
    s = in_motion("ur5")
    again = np.repeat(np.arange(0, len(s.time), 40), 40)[: len(s.time)]  # each stands for 40 ms
    held = Samples(s.time, s.q, s.qd, s.tau[again], s.wrench[again])
    pipeline = tl.Pipeline(robot_named("ur5"))
    run(pipeline, held)
    assert [c for c in pipeline.faults if c.fault == tl.Fault.STUCK] == []


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("signal", ["q", "qd"])
@pytest.mark.parametrize("value", [np.nan, np.inf, 1e12, "stuck"])
def test_a_position_or_velocity_that_is_lost_is_stood_in_for_by_the_other(name, signal, value):
    robot = robot_named(name)
    pipeline = tl.Pipeline(robot)
    run(pipeline, in_motion(name))
    for j in (1, 4):
        s = in_motion(name)
        values = getattr(s, signal)[:, j]
        values[AT : AT + 300] = values[AT] if value == "stuck" else value
        pipeline.reset()
        before = len(pipeline.events)
        estimate, _ = run(pipeline, s)
        channel = f"{signal}.{robot.joint_names[j]}"
        assert {c.channel for c in pipeline.faults} == {channel}
        assert pipeline.events[before:] == []
        settled = np.isfinite(estimate.segment_wrench[:, 0]).any(axis=1)
        assert settled[AT - 1] and settled[AT:].all()
        if value == "stuck":
            assert pipeline.faults[0].sample <= AT + 100
        else:
            bit = tl.Health.MISSING if np.isnan(value) else tl.Health.NON_FINITE
            told = np.flatnonzero(estimate.health & bit)
            assert told.tolist() == list(range(AT, AT + 300))
            assert np.all(estimate.health[AT : AT + 300] & tl.Health.FAULTY)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("fault", ["position stands", "velocity of the wrong sign"])
def test_what_disagrees_of_a_joint_slower_than_a_tenth_of_a_radian_per_second_is_told(name, fault):
    robot = robot_named(name)
    for j in range(len(robot.joint_names)):
        s = in_motion(name, swing=0.04)
        if not 0.04 < abs(s.qd[AT, j]) < 0.09:
            continue
        if fault == "position stands":
            s.q[AT:, j] = s.q[AT, j]
        else:
            s.qd[AT:, j] *= -1.0
        pipeline = tl.Pipeline(robot)
        run(pipeline, s)
        told = {c.channel.partition(".")[2]: c.sample for c in reversed(pipeline.faults)}
        assert set(told) == {robot.joint_names[j]}
        assert AT <= told[robot.joint_names[j]] <= AT + 50


def test_a_joint_without_position_and_velocity_is_not_made_up():
    robot = robot_named("sara")
    s = in_motion("sara")
    s.q[AT : AT + 100, 2] = s.qd[AT : AT + 100, 2] = np.nan
    pipeline = tl.Pipeline(robot)
    estimate, _ = run(pipeline, s)
    assert np.isnan(estimate.tau_ext[AT : AT + 100]).all()
    assert np.all(estimate.health[AT : AT + 100] & tl.Health.MISSING)
    assert np.isfinite(estimate.segment_wrench[-1]).all()
    assert {c.sample for c in pipeline.faults if c.fault == tl.Fault.NONE} == {AT + 100}


def test_a_wild_position_comes_back_in_a_recording_of_short_parts():
    """Where a joint stands after a pause nobody knows: nothing speaks against what it reports."""
    s = in_motion("ur5")
    rng = np.random.default_rng(2)
    s.q[AT : AT + 100, 2] += rng.uniform(0.5, 3.0, 100)
    pipeline = tl.Pipeline(robot_named("ur5"))
    parts = 6
    for part in range(parts):  # of 0.4 s, 1 s apart, each in a posture of its own
        rows = slice(AT - 400, AT + 50) if part == 0 else slice(AT + 100, AT + 500)
        time = s.time[rows] + 1.4 * part
        q = s.q[rows] + 0.3 * part * np.ones(6)
        tau, wrench = exact_loads(robot_named("ur5"), time, q, s.qd[rows])
        pipeline.run(time, q, s.qd[rows], tau, wrench)
        wild = [c.channel for c in pipeline.faults if c.fault == "wild"]
        assert part > 0 or wild == ["q.elbow_joint"]
    result = pipeline.update(time[-1] + 1e-3, q[-1], s.qd[rows][-1], tau[-1], wrench[-1])
    assert result.faults == ()


@pytest.mark.parametrize(("sign", "gain"), [(1.0, 1.0), (-1.0, 0.5)])
def test_known_friction_that_turns_with_its_joint_is_no_spike(sign, gain):
    """At 200 Hz 2 Nm of friction turn within a sample; a spike then is told as ever."""
    law = Friction(1.0, 0.0, 0.015, 1.1, 0.06)
    robot, s = robot_named("sara-full"), in_motion("sara-full", rate=200.0)
    joints = tuple(replace(j, friction=law, sign=sign, gain=gain) for j in robot.description.joints)
    rough = Robot(replace(robot.description, joints=joints), robot.mechanism)
    tau = (s.tau + law.dry(s.qd)) / (sign * gain)
    turning = (s.qd[60:-9] * s.qd[61:-8] < 0).any(axis=1)
    assert turning.sum() > 3
    pipeline = tl.Pipeline(rough, period=1 / 200)
    run(pipeline, replace(s, tau=tau))
    assert not pipeline.faults and not pipeline.events
    row = 61 + int(np.flatnonzero(turning)[0])
    joint = int(np.flatnonzero(s.qd[row - 1] * s.qd[row] < 0)[0])
    tau[row, joint] += SPIKES["tau"]
    pipeline = tl.Pipeline(rough, period=1 / 200)
    run(pipeline, replace(s, tau=tau))
    assert [str(c.fault) for c in pipeline.faults][:1] == ["spike"]
    assert pipeline.faults[0].channel == f"tau.{robot.joint_names[joint]}"
