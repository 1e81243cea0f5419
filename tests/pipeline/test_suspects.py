# SPDX-License-Identifier: Apache-2.0
"""What one channel alone would show is named, and is no sure contact; touches are not suspected."""

from dataclasses import replace

import numpy as np
import pytest
from test_parity import drifting, heard

import touchline as tl
from touchline.detector.thresholds import make_thresholds
from touchline.model.robot import Robot
from touchline.result.kinds import Fault
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run
from touchline.trials.faults import FAULTS, channels_of, injected
from touchline.trials.free_motion import FASTEST
from touchline.trials.recordings import PUSHED, RELEASED, prescribed_pushes, record, robot_named
from touchline.trials.scene import arm_and_skin
from touchline.trials.touches import TouchSampler, resting_signals, touch_loads

BEGIN = 0.6  # s
HIT = 2.2  # s


@pytest.fixture(scope="module")
def arm():
    robot = tl.load_robot("sara")
    return robot, tl.Pipeline(robot), record(robot, 1, pushed=False, seconds=1.0).samples


@pytest.fixture(scope="module")
def torques_alone():
    """An arm with joint torques alone; its link 6 is hit at HIT."""
    described = tl.load_robot("sara-full")
    noise = replace(described.description.noise, sensors={})
    description = replace(described.description, sensors=(), noise=noise, bandwidth_sensors={})
    robot = Robot(description, described.mechanism)
    profile = Profile(HIT, 0.3, 0.01, 0.02)
    blow = ScriptedContact(
        "link6", np.array([0.0, 0.0, 0.05]), np.array([9.0, 30.0, -40.0]), profile
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    return tl.Pipeline(robot), scripted(robot, [blow], 3.0, 0.5, settings).samples


def pushed(robot, link, force, hold, seconds):
    """Samples of a moving arm, 2 % off, that is pushed from BEGIN on for `hold` [s]."""
    push = ScriptedContact(
        link, np.array([0.0, 0.0, 0.05]), np.array(force), Profile(BEGIN, hold, 0.02, 0.02)
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    return scripted(robot, [push], seconds, 0.5, settings).samples


def faulty(robot, samples, name, channel, begin):
    """The samples with a fault of a channel from `begin` [s] on."""
    fault = next(f for f in FAULTS if f.name == name)
    place = next(c for c in channels_of(robot) if c.name == channel)
    return injected(samples, fault, place, begin, np.random.default_rng(0))[0]


@pytest.mark.parametrize(
    ("name", "within"),  # a push along a base sensor's axis rises as its force drifts, but is brief
    [("base.fx", 2.0), ("base.fz", 2.0), ("tau.joint4", 0.2)],
)
def test_a_channel_that_alone_explains_what_is_felt_is_named(arm, name, within):
    robot, pipeline, _ = arm
    samples = record(robot, 1, pushed=False, seconds=3.0).samples
    wrong = drifting(robot, samples, name)
    _, told, events = heard(pipeline, wrong)
    assert told[0].channel == name and told[0].fault == Fault.SUSPECT
    assert wrong.time[told[0].sample] - BEGIN < within
    assert events != []
    for event in events:
        assert event.level == "contact" and event.status != "located"
        assert (event.body_probability or 0.0) <= 0.5
        assert sum(c.probability for c in event.candidates) <= 0.5 + 1e-9


@pytest.mark.parametrize(
    ("link", "force"),
    [
        ("link1", [25.0, 0.0, 0.0]),
        ("link3", [0.0, -20.0, 12.0]),
        ("link6", [9.0, 0.0, -20.0]),
        ("tool", [0.0, 0.0, -20.0]),  # along an axis of the wrist sensor: the base feels it, too
    ],
)
def test_a_push_is_not_suspected(arm, link, force):
    robot, pipeline, _ = arm
    _, told, events = heard(pipeline, pushed(robot, link, force, 0.3, 1.0))
    assert told == []
    assert events != [] and events[0].level == "collision"


@pytest.mark.parametrize("force", [[-9.0, 0.0, 0.0], [-11.0, 11.0, 0.0]])
def test_a_push_along_axes_of_a_sensor_is_wrong_by_more_than_they_carry(force):
    """On the link that carries the sensor: one axis, or two as if they were swapped."""
    robot = robot_named("ur5")
    at = -0.06 * np.array(force) / np.linalg.norm(force)
    push = ScriptedContact(
        "shoulder_link", at, np.array(force), Profile(BEGIN, 0.4, 0.07, 0.07), force_frame="link"
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    pipeline = tl.Pipeline(robot)
    _, told, events = heard(pipeline, scripted(robot, [push], 1.4, 0.5, settings).samples)
    assert told == []
    assert [event.status for event in events] == ["ambiguous"]


@pytest.mark.parametrize("more", [[0.0, 4.0, 0.0], [0.0, 0.0, -5.0]])
def test_a_push_along_an_axis_that_turns_stays_one_event(more):
    """It turns 0.3 s after it began: from then on one axis alone does not explain it."""
    robot, at = robot_named("ur5"), np.array([0.06, 0.0, 0.0])
    pushes = [
        ScriptedContact(
            "shoulder_link", at, np.array(force), Profile(*when, 0.07, 0.07), force_frame="link"
        )
        for force, when in (([-9.0, 0.0, 0.0], (BEGIN, 0.8)), (more, (BEGIN + 0.3, 0.3)))
    ]
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    pipeline = tl.Pipeline(robot)
    _, told, events = heard(pipeline, scripted(robot, pushes, 1.9, 0.5, settings).samples)
    assert told == []
    assert len(events) == 1 and events[0].detected < BEGIN + 0.05
    assert events[0].cleared > BEGIN + 0.9


def test_what_a_push_might_be_is_told_when_most_pushes_are_over():
    """A force axis drifts beyond all that it carries, as slowly as a hand may push."""
    robot = robot_named("ur5")
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    samples = scripted(robot, [], 3.0, 0.5, settings).samples
    first = int(np.searchsorted(samples.time, BEGIN))
    samples.wrench[first:, 0, 0] -= np.minimum(150.0 * (samples.time[first:] - BEGIN), 12.0)
    _, told, events = heard(tl.Pipeline(robot), samples)
    assert {change.channel for change in told} == {"base.fx"}
    assert BEGIN + 1.75 < samples.time[told[0].sample] < BEGIN + 2.0
    assert all(event.level == "contact" for event in events)


@pytest.mark.parametrize("begin", [BEGIN - 0.1, BEGIN + 0.2])
def test_axes_of_the_base_sensor_that_are_swapped_are_named_and_place_no_push(arm, begin):
    """They are swapped before a push, or during it: their error looks like a push on the base."""
    robot, pipeline, _ = arm
    samples = pushed(robot, "link6", [18.0, -9.0, 0.0], 0.35, 1.0)
    first = int(np.searchsorted(samples.time, begin))
    samples.wrench[first:, 0] = samples.wrench[first:, 0][:, [1, 0, 2, 3, 4, 5]]
    _, told, events = heard(pipeline, samples)
    assert {"base.fx", "base.fy"} <= {change.channel for change in told}
    sure = [e for e in events if e.status == "located" and (e.body_probability or 0.0) >= 0.9]
    assert {event.body for event in sure} <= {"link6"}


@pytest.mark.parametrize("channel", ["base.fz", "base.mz", "tau.joint4"])
def test_a_reading_that_comes_late_is_no_new_contact_as_a_push_lets_go(arm, channel):
    """It still shows what has gone: that looked like another push, against the one that ends."""
    robot, pipeline, _ = arm
    samples = pushed(robot, "link5", [18.0, -9.0, 6.0], 0.3, 1.3)
    wrong = faulty(robot, samples, "delay", channel, BEGIN - 0.3)
    _, _, healthy = heard(pipeline, samples)
    _, _, events = heard(pipeline, wrong)
    assert [(e.body, e.level) for e in events] == [(e.body, e.level) for e in healthy]


@pytest.mark.parametrize("name", ["wrist", "handle"])
def test_axes_that_are_swapped_as_a_push_lets_go_are_named_and_are_no_place(name):
    """The sensor inboard feels the push fade, and then the opposite of what they are wrong by."""
    robot = tl.load_robot("sara-full")
    recording = record(robot, 4)
    wrong = faulty(robot, recording.samples, "swapped axes", name, RELEASED)
    _, told, events = heard(tl.Pipeline(robot), wrong)
    assert {f"{name}.fx", f"{name}.fy"} <= {change.channel for change in told}
    assert wrong.time[told[0].sample] - RELEASED < 0.1
    sure = [e for e in events if e.status == "located" and (e.body_probability or 0.0) >= 0.9]
    assert {event.body for event in sure} <= {recording.body}


def test_a_push_beside_a_suspect_is_an_event_of_its_own(arm):
    """The phantom is one event, the push another: a collision, on the link that is pushed."""
    robot, pipeline, _ = arm
    profile = Profile(BEGIN + 0.2, 0.15, 0.02, 0.02)
    push = ScriptedContact(
        "link6", np.array([0.0, 0.0, 0.05]), np.array([9.0, 0.0, -20.0]), profile
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    samples = scripted(robot, [push], 1.0, 0.5, settings).samples
    samples.tau[samples.time > BEGIN - 0.1, 3] += 3.0
    _, told, events = heard(pipeline, samples)
    assert {change.channel for change in told} == {"tau.joint4"}
    began = [event for event in events if event.level == "collision"]
    assert len(began) == 1 and abs(began[0].detected - BEGIN - 0.2) < 0.03
    assert [event for event in events if event.detected < BEGIN + 0.1] != []


def test_a_fault_elsewhere_is_no_reason_for_doubt(arm):
    """A torque that outer links do not load jumps for good: their pushes are as sure as ever."""
    robot, pipeline, _ = arm
    profile = Profile(BEGIN, 0.3, 0.02, 0.02)
    push = ScriptedContact(
        "handle", np.array([0.0, 0.0, 0.03]), np.array([6.0, -16.0, 9.0]), profile
    )
    settings = Run(seed=3, noise=SensorNoise(), model_error=0.02, physics=2000.0)
    samples = scripted(robot, [push], 1.0, 0.5, settings).samples
    _, _, (healthy, *_) = heard(pipeline, samples)
    first = int(np.searchsorted(samples.time, BEGIN - 0.1))
    samples.tau[first:, 1] = samples.tau[first, 1]  # stuck
    _, told, events = heard(pipeline, samples)
    assert {(c.channel, c.fault) for c in told} == {("tau.joint2", Fault.STUCK)}
    event = next(e for e in events if e.segment == healthy.segment)
    assert (event.status, event.link, event.level) == ("located", "handle", healthy.level)
    assert event.body_probability == pytest.approx(healthy.body_probability, abs=0.05)


@pytest.mark.parametrize(
    ("name", "channel"),
    [("spikes", "tau.joint4"), ("garbage", "wrist.fx"), ("stuck", "wrist.my"), ("rail", "base.fz")],
)
def test_a_blow_that_shows_without_a_faulty_channel_is_a_collision(arm, name, channel):
    """A wrench does without joint torques, and who steps in for a sensor does without that."""
    robot, pipeline, _ = arm
    samples = pushed(robot, "link5", (9.0, 0.0, -30.0), 0.3, 1.2)
    _, _, (healthy, *_) = heard(pipeline, samples)
    assert healthy.level == "collision"
    _, told, events = heard(pipeline, faulty(robot, samples, name, channel, BEGIN - 0.2))
    assert channel in {change.channel for change in told}
    found = [event for event in events if event.level == "collision"]
    assert found != [] and found[0].detected == pytest.approx(healthy.detected, abs=0.02)


@pytest.mark.parametrize("name", ["noisy", "garbage", "stuck"])
def test_a_blow_that_other_joints_show_is_a_collision(torques_alone, name):
    """The torque of one joint is faulty, and stands for no force: the others do."""
    pipeline, samples = torques_alone
    _, _, (healthy,) = heard(pipeline, samples)
    wrong = faulty(pipeline.robot, samples, name, "tau.joint6", HIT - 0.3)
    _, told, events = heard(pipeline, wrong)
    assert "tau.joint6" in {change.channel for change in told}
    (found,) = [event for event in events if event.level == "collision"]
    assert found.detected == pytest.approx(healthy.detected, abs=0.02)


@pytest.mark.parametrize("fault", [("double", "wrist.fy"), ("half", "wrist.fx")])
def test_a_blow_is_not_what_a_faulty_sensor_felt_before(fault):
    """Who steps in has listened and not felt that: it is over, and the blow is another event."""
    robot = tl.load_robot("sara")
    recording = record(robot, 0)
    _, told, events = heard(tl.Pipeline(robot), faulty(robot, recording.samples, *fault, 0.6))
    assert {(change.channel, change.fault) for change in told} >= {(fault[1], Fault.DISAGREES)}
    (blow,) = [event for event in events if event.level == "collision"]
    assert abs(blow.detected - PUSHED) < 0.02
    before = [event for event in events if event.detected < PUSHED]
    assert before != [] and max(event.cleared for event in before) <= blow.detected


@pytest.mark.parametrize("part", [-1.0, -0.5, 3.0])
def test_a_joint_torque_that_steps_alone_is_no_collision_then_or_later(torques_alone, part):
    """Of joint torques alone a push may load one, but no blow does so within one sample."""
    pipeline, samples = torques_alone
    wrong = scaled(samples, "joint2", part, BEGIN, HIT - 0.2)
    _, _, events = heard(pipeline, wrong)
    phantoms = [event for event in events if event.detected < HIT - 0.2]
    assert phantoms != [] and abs(phantoms[0].detected - BEGIN) < 0.02
    assert {event.level for event in phantoms} == {"contact"}


def test_a_blow_after_a_step_is_a_collision(torques_alone):
    pipeline, samples = torques_alone
    _, _, (healthy,) = heard(pipeline, samples)
    assert healthy.level == "collision"
    wrong = scaled(samples, "joint2", -1.0, BEGIN, BEGIN + 0.3)
    _, _, events = heard(pipeline, wrong)
    (found,) = [event for event in events if event.level == "collision"]
    assert found.detected == pytest.approx(healthy.detected, abs=0.02)


def pushed_panda(seed):
    """A Panda with torques alone, its recording with a push, and the event of that, a contact."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    robot = robot_named("panda")
    samples, pipeline = record(robot, seed).samples, tl.Pipeline(robot)
    _, _, (healthy,) = heard(pipeline, samples)
    assert healthy.level == "contact"
    return robot, samples, pipeline, healthy


def test_a_torque_that_steps_as_a_push_lets_go_is_told_and_is_no_collision():
    """What the push does to the other joints meanwhile does not bear the step out."""
    robot, samples, pipeline, _ = pushed_panda(0)
    _, told, events = heard(pipeline, faulty(robot, samples, "half", "tau.panda_joint4", RELEASED))
    assert (told[0].channel, told[0].fault) == ("tau.panda_joint4", Fault.SPIKE)
    assert samples.time[told[0].sample] == pytest.approx(RELEASED, abs=0.0015)
    assert {event.level for event in events} == {"contact"}


def test_what_one_joint_torque_alone_makes_of_a_push_is_no_collision():
    """Twice the torque of one joint: no single force does that, and others show no blow."""
    _, samples, pipeline, healthy = pushed_panda(110)
    wrong = scaled(samples, "joint1", 2.0, PUSHED, 3.0)
    _, _, events = heard(pipeline, wrong)
    event = next(e for e in events if e.detected == pytest.approx(healthy.detected, abs=0.02))
    assert (event.status, event.level) == ("not_separable", "contact")
    assert PUSHED + 0.05 < event.decided < PUSHED + 0.2  # not before a place may have been found


def scaled(samples, joint, part, begin, end):
    """A copy in which a joint's torque is this part of itself for a while."""
    tau = samples.tau.copy()
    during = (samples.time >= begin) & (samples.time < end)
    tau[during, int(joint[-1]) - 1] *= part
    return replace(samples, tau=tau)


@pytest.mark.parametrize(("part", "told"), [(0.85, False), (1.5, True)])
def test_of_what_a_push_leaves_only_more_than_a_threshold_is_a_fault(part, told):
    """The arm has moved on since its baseline: a part of a threshold is its model's error."""
    robot = tl.load_robot("sara")
    samples = pushed(robot, "link4", [10.0, 12.0, -15.0], 0.5, 2.0)
    joint = robot.joint_names.index("joint4")
    threshold = next(
        row.contact for row in make_thresholds(robot, 0.001).rows if row.joint == joint
    )
    creeps = np.clip((samples.time - BEGIN) / 0.5, 0.0, 1.0)
    samples.tau[:, joint] += part * threshold * creeps
    pipeline = tl.Pipeline(robot)
    _, faults, events = heard(pipeline, samples)
    assert len(events) == 1
    assert {change.channel for change in faults} == ({"tau.joint4"} if told else set())


def test_a_sudden_push_that_only_one_axis_shows_at_first_is_a_sure_place():
    """Noise hides what the other channels have of it in the sample in which it begins."""
    robot, skin = arm_and_skin("panda", 3)
    rng = np.random.default_rng(5)
    sampler, doubted, right = TouchSampler(skin, rng), 0, 0
    while doubted < 4:
        touch = sampler.sample(20.0)
        load = touch_loads(robot, touch.q, touch.patch.node, touch.position, touch.force)
        force, others = np.sort(np.abs(load[-6:-3])), np.append(load[:-6], load[-3:])
        if force[1] > 2.0 or np.abs(others).max() > 1.2:
            continue
        s = resting_signals(robot, touch.q, [(touch, BEGIN)], BEGIN + 0.1, rng)
        pipeline = tl.Pipeline(robot, skin=skin)
        pipeline.run(s.time[:-1], s.q[:-1], s.qd[:-1], s.tau[:-1], s.wrench[:-1])
        last = pipeline.update(s.time[-1], s.q[-1], s.qd[-1], s.tau[-1], s.wrench[-1])
        jumps = [f for f in pipeline.faults if f.fault == Fault.SPIKE and s.time[f.sample] >= BEGIN]
        if not jumps:
            continue
        doubted += 1
        (contact,) = last.contacts
        assert contact.level == "contact"  # it may yet be the sensor that has jumped
        assert contact.status == "located" and contact.body == touch.patch.body
        right += np.linalg.norm(contact.position - touch.position) < 0.0225
    assert right >= 3


@pytest.mark.parametrize(("seed", "seconds"), [(3114, 14.0), (4105, 60.0)])
def test_what_a_model_errs_by_in_fast_motion_is_no_fault(arm, seed, seconds):
    _, pipeline, _ = arm
    samples, _ = prescribed_pushes(pipeline.robot, seed, seconds, FASTEST)
    _, faults, _ = heard(pipeline, samples)
    assert faults == []


def test_a_push_along_a_force_of_the_base_sensor_of_a_fast_arm_is_no_fault(arm):
    # The axis carries 330 N, and the arm's motion changes that by as much as the push.
    _, pipeline, _ = arm
    samples, _ = prescribed_pushes(pipeline.robot, 3119, 30.0, FASTEST)
    _, faults, _ = heard(pipeline, samples)
    assert faults == []
