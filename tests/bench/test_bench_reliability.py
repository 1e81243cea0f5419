# SPDX-License-Identifier: Apache-2.0
"""The reliability benchmark, in short: faults that must be told, and none where there is none."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.bench.reliability.campaign import Kept, Part, run_all
from touchline.bench.reliability.judge import judge, listen
from touchline.bench.reliability.run import Health, Plan, healthy_motion, tables, untold_channels
from touchline.check.parity import parity_of
from touchline.cli import main
from touchline.errors import InputError
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run
from touchline.trials.faults import FAULTS, channels_of, injected
from touchline.trials.recordings import (
    EVERY,
    FORCE,
    LASTS,
    MODEL_ERROR,
    PHASES,
    PUSHED,
    RELEASED,
    SECONDS,
    SPEED,
    prescribed_pushes,
    record,
    robot_named,
)

AT_ONCE = ("spike", "spikes", "rail", "NaN", "infinite", "absurd")


@pytest.fixture(scope="module")
def listened():
    robot = tl.load_robot("sara-full")
    recording = record(robot, 0)
    pipeline = tl.Pipeline(robot)
    return pipeline, recording, listen(pipeline, recording.samples)


def channel_named(robot, name):
    return next(channel for channel in channels_of(robot) if channel.name == name)


def fault_named(name):
    return next(fault for fault in FAULTS if fault.name == name)


def test_each_type_of_fault_changes_its_channel_and_no_other(listened):
    recording = listened[1]
    for fault in FAULTS:
        for channel in channels_of(recording.robot):
            whole = channel.signal == "wrench" and channel.axis is None
            if ("sensor" if whole else channel.signal) not in fault.on:
                continue
            rng = np.random.default_rng(0)
            faulty, end = injected(recording.samples, fault, channel, 0.6, rng)
            assert end > 0.59
            for signal in ("time", "q", "qd", "tau", "wrench"):
                before, after = getattr(recording.samples, signal), getattr(faulty, signal)
                same = np.array_equal(before, after, equal_nan=True)
                if signal != channel.signal:
                    assert same, (fault.name, channel.name)
                elif fault.name != "clipped":  # a signal may stay below its rail
                    assert not same, (fault.name, channel.name)


def test_without_a_fault_none_is_reported(listened):
    assert listened[2].named == {}


@pytest.mark.parametrize("name", AT_ONCE)
@pytest.mark.parametrize("phase", ["free", "contact"])
def test_what_jumps_or_is_absent_is_told_in_the_same_sample(listened, name, phase):
    pipeline, recording, healthy = listened
    channel = channel_named(recording.robot, "tau.joint2")
    outcome = judge(
        pipeline, recording, healthy, fault_named(name), channel, (phase, PHASES[phase])
    )
    assert outcome.crash == "" and outcome.finite
    assert outcome.told <= 0.0015
    assert outcome.collisions == 0


@pytest.mark.parametrize("name", ["stuck", "zero"])
def test_what_stands_still_is_told_within_50_ms(listened, name):
    pipeline, recording, healthy = listened
    channel = channel_named(recording.robot, "tau.joint2")
    outcome = judge(
        pipeline, recording, healthy, fault_named(name), channel, ("free", PHASES["free"])
    )
    assert outcome.told <= 0.05 and outcome.named


@pytest.fixture(scope="module")
def pushed_sara():
    recording = record(tl.load_robot("sara"), 1)
    pipeline = tl.Pipeline(recording.robot)
    return pipeline, recording, listen(pipeline, recording.samples)


def with_fault(listened, fault, channel, phase):
    """What is said of a recording with it."""
    pipeline, recording, _ = listened
    where = channel_named(recording.robot, channel)
    rng = np.random.default_rng(0)
    faulty, end = injected(recording.samples, fault_named(fault), where, PHASES[phase], rng)
    return listen(pipeline, faulty), end


def test_a_push_as_a_lost_sensor_comes_back_is_felt_until_its_end_and_placed(pushed_sara):
    """Only joints feel its first moments: what they have then is no offset, and no friction."""
    said, _ = with_fault(pushed_sara, "NaN", "base.fx", "free")
    assert [e.segment for e in said.events] == ["base"]
    assert said.events[0].body == pushed_sara[1].body
    assert (said.events[0].body_probability or 0.0) > 0.9
    assert (said.events[0].cleared or np.inf) > RELEASED


@pytest.mark.parametrize("name", ["NaN", "rail", "stuck", "garbage", "sensor garbage"])
@pytest.mark.parametrize("phase", ["free", "contact"])
def test_estimates_are_back_five_time_constants_after_a_fault(pushed_sara, name, phase):
    pipeline, recording, healthy = pushed_sara
    channel = channel_named(recording.robot, "wrist" if name.startswith("sensor") else "wrist.fy")
    outcome = judge(
        pipeline, recording, healthy, fault_named(name), channel, (phase, PHASES[phase])
    )
    assert outcome.recovery <= 0.051


@pytest.mark.parametrize("name", ["noisy", "garbage"])
def test_a_wild_torque_that_passes_by_chance_counts_only_once_it_is_over(pushed_sara, name):
    said, end = with_fault(pushed_sara, name, "tau.joint2", "free")
    time = pushed_sara[1].samples.time
    lost = (time > PHASES["free"] + 0.03) & (time < end + 0.04)  # by then it is told
    joint = pushed_sara[1].robot.joint_names.index("joint2")
    assert not said.estimate.joint_settled[lost, joint].any()


def recorded(name, seed):
    """A recording of an arm, and a pipeline that has heard nothing."""
    robot = tl.load_robot(name)
    return tl.Pipeline(robot), record(robot, seed), None


def test_a_gap_in_a_push_that_lasts_is_no_blow():
    """The filters begin anew after it: they rise from zero as if something struck the arm."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    said, _ = with_fault(recorded("panda", 110), "gap", "time", "contact")
    assert [e.level for e in said.events] == ["contact"]


def test_a_sensor_that_dies_as_a_push_is_let_go_strikes_nobody():
    """Its weight is gone at once, as if one force had lifted it."""
    said, _ = with_fault(recorded("sara-full", 110), "sensor zero", "base", "release")
    assert [e.level for e in said.events if e.detected > RELEASED - 0.01] == ["contact"]


@pytest.mark.parametrize("rise", [0.005, 0.05])
def test_a_push_along_an_axis_of_the_innermost_sensor_is_no_fault(rise):
    """That axis carries the weight of the arm: an error of its scale would come within a sample."""
    robot = tl.load_robot("sara")
    point, force = np.array([0.002, 0.001, 0.05]), np.array([0.0, 0.0, -FORCE])
    push = ScriptedContact("link0", point, force, Profile(0.6, 0.5, rise, rise), force_frame="link")
    settings = Run(seed=1, noise=SensorNoise(), model_error=MODEL_ERROR, physics=2000.0)
    said = listen(tl.Pipeline(robot), scripted(robot, [push], 1.5, SPEED, settings).samples)
    assert said.named == {}
    assert [(e.segment, e.level, e.detected < 0.65) for e in said.events] == [
        ("base", "contact", True)
    ]


def test_axes_that_are_swapped_beside_a_push_are_named_within_moments(pushed_sara):
    pipeline, recording, healthy = pushed_sara
    channel = channel_named(recording.robot, "handle")
    phase = ("contact", PHASES["contact"])
    outcome = judge(pipeline, recording, healthy, fault_named("swapped axes"), channel, phase)
    assert outcome.named and outcome.told < 0.05
    assert outcome.wrong == outcome.collisions == 0


def test_what_a_wrong_speed_begins_before_it_is_told_has_no_sure_place_and_is_no_collision():
    robot = tl.load_robot("sara-full")
    recording = record(robot, 2)
    listened = tl.Pipeline(robot), recording, None
    said, _ = with_fault(listened, "speed zero", "qd.joint3", "free")
    began = [e for e in said.events if e.detected < PUSHED]
    assert began != []
    for event in began:
        assert event.level == "contact" and (event.body_probability or 0.0) <= 0.5


def test_the_tables_count_what_was_missed(listened):
    pipeline, recording, healthy = listened
    channel = channel_named(recording.robot, "tau.joint2")
    outcomes = [
        judge(pipeline, recording, healthy, fault_named(name), channel, ("free", PHASES["free"]))
        for name in ("spike", "delay")
    ]
    text, missed = tables(outcomes, [Health("simulated", 1.0, 40, ("sara: tau.joint1 stuck",) * 2)])
    assert "delay, tau" in text and "spike, tau" in text
    assert "false reports in 1.00 h of simulated motion, 40 pushes" in text
    assert missed


def test_healthy_arms_are_pushed_every_few_seconds(monkeypatch):
    monkeypatch.setattr("touchline.trials.recordings.ROBOTS", ("sara",))
    simulated, prescribed, fast = healthy_motion(Plan(healthy=0.15, hours=30.0 / 3600.0))
    assert simulated.hours == pytest.approx(9.0 / 3600.0) and simulated.pushes == 3
    assert prescribed.hours == pytest.approx(30.0 / 3600.0) and prescribed.pushes == 10
    assert not simulated.reports and not prescribed.reports
    assert fast.hours == prescribed.hours and fast.pushes == 10


def test_of_fast_motion_reports_are_counted_without_a_goal(listened):
    pipeline, recording, healthy = listened
    channel, phase = channel_named(recording.robot, "tau.joint2"), ("free", PHASES["free"])
    outcomes = [judge(pipeline, recording, healthy, fault_named("spike"), channel, phase)]
    text, _ = tables(outcomes, [Health("fast", 10.0, 9, ("sara: tau.joint1 suspect",) * 9)])
    (line,) = (x for x in text.splitlines() if "10.00 h of fast motion" in x)
    assert line.split()[-2:] == ["none", "9"]


def test_of_what_was_not_run_nothing_is_said_to_be_missed():
    text, missed = tables([], [Health("prescribed", 10.0, 9, ("sara: tau.joint1 suspect",))])
    told = "false reports in 10.00 h of prescribed motion, 9 pushes 1 in 10 h 1"
    assert [" ".join(line.split()) for line in text.splitlines()] == [
        "figure goal here",
        told,
        "",
        "sara: tau.joint1 suspect",
    ]
    assert not missed


@pytest.mark.parametrize("name", ["sara", "panda"])
def test_each_push_of_a_prescribed_motion_is_felt_when_it_is_there(name):
    robot = robot_named(name)
    samples, pushes = prescribed_pushes(robot, 3, 20.0)
    said = listen(tl.Pipeline(robot), samples)
    begun = [round((event.detected - 1.0) // EVERY) for event in said.events]
    assert begun == list(range(pushes))
    assert all((event.detected - 1.0) % EVERY < 0.1 for event in said.events)
    assert all(event.cleared - event.detected < LASTS[1] + 0.3 for event in said.events)


def test_what_the_layout_cannot_tell_is_counted_apart(listened):
    pipeline, recording, healthy = listened
    outcomes = [
        judge(
            pipeline,
            recording,
            healthy,
            fault_named("delay"),
            channel_named(recording.robot, name),
            ("contact", PHASES["contact"]),
        )
        for name in ("wrist.fz", "tau.joint2")
    ]
    late = [replace(outcome, told=9.0, harmless=False) for outcome in outcomes]
    text, _ = tables(late, [Health("simulated", 1.0, 40, ())])
    lines = {" ".join(line.split()) for line in text.splitlines()}
    assert "and in 1 runs that the layout cannot tell none 0.0 %" in lines
    assert "sara-full delay wrist.fz 1 of 1 the layout cannot" in lines
    assert "sara-full delay tau.joint2 1 of 1" in lines


def test_what_check_lists_is_what_the_layout_cannot_tell():
    robot = tl.load_robot("sara-full")
    blind = parity_of(robot).blind
    assert set(untold_channels(robot)) == {*blind, "wrist"}  # all axes: the whole sensor


def test_a_push_that_a_slow_joint_feels_first_is_felt_until_its_end():
    """Its first sample over a limit is a slow joint's alone: no friction, the base feels it too."""
    robot = tl.load_robot("sara")
    point, force = np.array([-0.03061891, -0.00220524, 0.18129566]), np.array([0.0, -FORCE, 0.0])
    profile = Profile(PUSHED, RELEASED - PUSHED - 0.04, 0.02, 0.02)
    push = ScriptedContact("link5", point, force, profile, force_frame="link")
    settings = Run(seed=0, noise=SensorNoise(), model_error=MODEL_ERROR, physics=2000.0)
    said = listen(tl.Pipeline(robot), scripted(robot, [push], SECONDS, SPEED, settings).samples)
    assert [(e.segment, e.detected < 0.93, e.cleared > 1.39) for e in said.events] == [
        ("base", True, True)
    ]


def test_what_is_pushed_can_be_reached_from_outside():
    recording = record(tl.load_robot("sara"), 0)
    assert recording.body != "link5"  # its first draw lies inside link6


def test_runs_that_are_kept_are_not_run_again(tmp_path):
    part = Part("sara-full", 0, 0.0015)
    first = list(run_all([part], tmp_path, 1))
    path = Kept(tmp_path).file(part)
    lines = path.read_text().splitlines()
    assert len(first) == len(lines) >= 2
    # The last run was cut off as it was written: it alone is run again.
    path.write_text("\n".join([*lines[:-1], lines[-1][:20]]))
    again = list(run_all([part], tmp_path, 1))
    assert path.read_text().splitlines()[:-1] == [*lines[:-1], lines[-1][:20]]
    told = [(o.fault.name, o.channel.name, o.phase, o.told, o.phantoms) for o in first]
    assert told == [(o.fault.name, o.channel.name, o.phase, o.told, o.phantoms) for o in again]


def test_runs_of_another_build_are_refused(tmp_path):
    (tmp_path / "build.txt").write_text("0123456789abcdef\n")
    with pytest.raises(InputError, match="another build"):
        Kept(tmp_path)


def test_more_than_all_cases_are_refused(capsys):
    assert main(["bench", "reliability", "--share", "2"]) == 2
    assert "--share 2: must be at most 1" in capsys.readouterr().err
