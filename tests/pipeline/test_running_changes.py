# SPDX-License-Identifier: Apache-2.0
"""What changes while a robot runs: reset, tare, a load that a gripper has closed on."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import exact_loads, free_motion, pushed

import touchline as tl
from touchline.errors import InputError
from touchline.identify.payload import weigh_load
from touchline.model.corrections import with_loads
from touchline.model.description import Load
from touchline.model.perturbed import perturbed
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.noise import SensorNoise
from touchline.simulation.scenario import scripted
from touchline.simulation.scene import Run

LINK = "tool"


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def at_rest(robot, seconds=1.0, rate=1000.0, q=None, noise=0.01, seed=0):
    """Samples of an arm that stands still."""
    count = round(seconds * rate)
    q = np.linspace(0.3, 0.9, len(robot.joint_names)) if q is None else q
    time, q = np.arange(count) / rate, np.tile(q, (count, 1))
    qd = np.zeros_like(q)
    tau, wrench = exact_loads(robot, time, q, qd)
    rng = np.random.default_rng(seed)
    tau = tau + rng.normal(0.0, noise, tau.shape)
    return Samples(time, q, qd, tau, wrench + rng.normal(0.0, noise, wrench.shape))


def feed(pipeline, samples, start=0.0):
    """The estimate of each sample, which begin at `start`."""
    return pipeline.run(samples.time + start, samples.q, samples.qd, samples.tau, samples.wrench)[0]


def carrying(robot, mass, com=(0.0, 0.0, 0.05)):
    inertia = (mass * 1e-3, 0.0, 0.0, mass * 1e-3, 0.0, mass * 1e-3)
    changed = with_loads(robot.mechanism, robot.description, (Load(LINK, mass, com, inertia),))
    return Robot(*changed)


def test_a_tare_takes_off_what_is_felt_at_rest(sara):
    rng = np.random.default_rng(1)
    still = at_rest(sara)
    still.tau[:] += rng.normal(0.0, 1.0, 7)
    still.wrench[:] += rng.normal(0.0, 2.0, (len(sara.sensor_names), 6))
    pipeline = tl.Pipeline(sara)
    before = feed(pipeline, still)
    taken = pipeline.tare()
    after = feed(pipeline, still, 1.0)
    assert np.abs(before.tau_ext[-1]).max() > 0.5
    assert np.abs(before.sensor_wrench[-1]).max() > 1.0
    np.testing.assert_allclose(after.tau_ext[-200:].mean(axis=0), 0.0, atol=0.01)
    np.testing.assert_allclose(after.sensor_wrench[-200:].mean(axis=0), 0.0, atol=0.02)
    np.testing.assert_allclose(taken.torque, before.tau_ext[-500:].mean(axis=0), atol=0.02)
    assert taken.time == pytest.approx(still.time[-1])


def test_the_biases_of_a_tare_stand_in_the_robot(sara):
    still = at_rest(sara, noise=0.0)
    still.tau[:] += 0.7
    pipeline = tl.Pipeline(sara)
    feed(pipeline, still)
    pipeline.tare()
    joints = pipeline.robot.description.joints
    expected = [0.7 if joint.measured else 0.0 for joint in joints]
    np.testing.assert_allclose([joint.bias for joint in joints], expected, atol=1e-3)
    assert all(joint.bias == 0.0 for joint in sara.description.joints)


def test_a_tare_needs_rest(sara):
    moving = free_motion(sara, seconds=1.0, rate=1000.0)
    pipeline = tl.Pipeline(sara)
    feed(pipeline, moving)
    with pytest.raises(ValueError, match=r"tare needs 0\.5 s of rest"):
        pipeline.tare()
    pipeline.reset()
    feed(pipeline, at_rest(sara, seconds=0.3), 2.0)
    with pytest.raises(ValueError, match="it was 0"):
        pipeline.tare()


def touched_tool(robot, samples, newtons):
    """With a hand that presses on the tool all the time."""
    return pushed(robot, samples, LINK, slice(None), [0.0, 0.0, -newtons])


@pytest.mark.parametrize("newtons", [4.0, 20.0])
def test_a_touch_is_not_tared(sara, newtons):
    still, pipeline = at_rest(sara), tl.Pipeline(sara)
    feed(pipeline, still)
    feed(pipeline, touched_tool(sara, still, newtons), 1.0)
    with pytest.raises(ValueError, match=r"take a touch for an offset: something has touched .* N"):
        pipeline.tare()
    assert pipeline.robot is sara


def test_a_touch_that_is_over_is_in_no_tare(sara):
    still, pipeline = at_rest(sara), tl.Pipeline(sara)
    feed(pipeline, still)
    feed(pipeline, touched_tool(sara, still, 20.0), 1.0)
    feed(pipeline, still.where(still.time < 0.5), 2.0)
    with pytest.raises(ValueError, match=r"tare needs 0\.5 s of rest without a touch"):
        pipeline.tare()
    feed(pipeline, still, 2.5)
    taken = pipeline.tare()
    assert np.abs(taken.wrench).max() < 0.1 and np.nanmax(np.abs(taken.torque)) < 0.1
    assert taken.doubt == ""


@pytest.mark.parametrize("since", ["the start", "a reset"])
def test_what_touched_the_arm_all_the_time_is_told_of_a_tare(sara, since):
    pipeline = tl.Pipeline(sara)
    touched = touched_tool(sara, at_rest(sara), 20.0)
    if since == "a reset":
        feed(pipeline, at_rest(sara))
        feed(pipeline, touched, 1.0)
        pipeline.reset()
    feed(pipeline, touched, 2.0)
    taken = pipeline.tare()
    assert "rests on the arm" in taken.doubt and "wrist.fy" in taken.doubt
    assert np.abs(taken.wrench).max() == pytest.approx(20.0, abs=0.1)


def test_a_load_beside_a_touch_is_told(sara):
    still, pipeline = at_rest(sara, noise=0.0), tl.Pipeline(sara)
    feed(pipeline, still)
    feed(pipeline, touched_tool(sara, still, 20.0), 1.0)
    told = pipeline.set_load(LINK, 0.5, (0.0, 0.0, 0.05))
    assert "something has touched" in told and "4.9 N" in told
    lifted = tl.Pipeline(sara)
    feed(lifted, still)
    feed(lifted, at_rest(carrying(sara, 1.2), noise=0.0), 1.0)
    assert any(event.cleared is None for event in lifted.events)
    assert lifted.set_load(LINK, 1.2, (0.0, 0.0, 0.05)) == ""


def test_a_load_that_is_set_is_no_longer_felt(sara):
    loaded = at_rest(carrying(sara, 1.2), noise=0.0)
    pipeline = tl.Pipeline(sara)
    before = feed(pipeline, loaded)
    pipeline.set_load(LINK, 1.2, (0.0, 0.0, 0.05), (1.2e-3, 0, 0, 1.2e-3, 0, 1.2e-3))
    after = feed(pipeline, loaded, 1.0)
    assert np.abs(before.segment_wrench[-1]).max() > 5.0
    assert np.abs(after.segment_wrench[-1]).max() < 1e-6
    pipeline.set_load(LINK, 0.0)
    again = feed(pipeline, loaded, 2.0)
    np.testing.assert_allclose(again.segment_wrench[-1], before.segment_wrench[-1], atol=1e-9)


def test_a_load_replaces_the_one_before_but_not_the_description_s(sara):
    described = carrying(sara, 0.5)
    pipeline = tl.Pipeline(described)
    for mass in (0.3, 0.8):
        pipeline.set_load(LINK, mass)
    masses = [load.mass for load in pipeline.robot.description.loads]
    assert masses == [0.5, 0.8]
    own = sara.mechanism.links[LINK].inertia.mass
    assert pipeline.robot.mechanism.links[LINK].inertia.mass == pytest.approx(own + 1.3)


WRONG_LOADS = [
    (("toool", 1.0), "unknown link 'toool'"),
    ((LINK, -1.0), "mass is -1.0"),
    ((LINK, np.nan), "mass is nan"),
    ((LINK, 1.0, (0.0, 0.0)), "com needs 3 numbers"),
    ((LINK, 1.0, (0.0, 0.0, np.inf)), "finite"),
    ((LINK, 1.0, (0.0, 0.0, 0.0), (1.0,)), "inertia needs 6 numbers"),
    ((LINK, 1e9), r"mass is 1e\+09 kg, but at most [\d.]+ kg are allowed: 2 times what moves"),
    ((LINK, 80.0), "mass is 80 kg"),
    ((LINK, 1.0, (0.0, 4.0, 3.0)), r"com is 5 m from .* at most [\d.]+ m are allowed"),
    ((LINK, 1.0, (0.0, 0.0, 0.0), (1.0, 0, 0, 1.0, 0, 2.01)), "inertia .* no body has these"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG_LOADS)
def test_a_load_that_cannot_be_is_refused(sara, arguments, message):
    pipeline = tl.Pipeline(sara)
    with pytest.raises(ValueError, match=message):
        pipeline.set_load(*arguments)
    assert pipeline.robot is sara


def test_events_end_with_a_reset_and_their_numbers_go_on(sara):
    pipeline = tl.Pipeline(sara)
    still = at_rest(sara)
    feed(pipeline, still)
    touched = replace(still, wrench=still.wrench + np.array([0.0, 0.0, -30.0, 0.0, 0.0, 0.0]))
    feed(pipeline, touched, 1.0)
    assert pipeline.events and pipeline.events[-1].cleared is None
    count = len(pipeline.events)
    pipeline.reset()
    assert len(pipeline.events) == count
    assert all(event.cleared is not None for event in pipeline.events)
    told = pipeline.update(2.5, *(x[0] for x in (still.q, still.qd, still.tau, still.wrench)))
    assert "ended" in [change.happened for change in told.events]
    feed(pipeline, still, 3.0)
    feed(pipeline, touched, 4.0)
    ids = [event.id for event in pipeline.events]
    assert ids == sorted(set(ids)) and len(ids) > count


def test_after_a_reset_all_is_as_at_the_start(sara):
    still = at_rest(sara)
    once, again = tl.Pipeline(sara), tl.Pipeline(sara)
    feed(again, free_motion(sara, seconds=1.0, rate=1000.0))
    again.reset()
    expected, found = feed(once, still, 5.0), feed(again, still, 5.0)
    np.testing.assert_array_equal(expected.tau_ext, found.tau_ext)
    np.testing.assert_array_equal(expected.segment_wrench, found.segment_wrench)


@pytest.mark.parametrize("lost", [False, True])
def test_after_a_reset_stand_ins_are_as_at_the_start(sara, lost):
    still = at_rest(sara)
    dead = replace(still, wrench=still.wrench.copy())
    dead.wrench[300:700, 0] = np.nan
    once, again = tl.Pipeline(sara), tl.Pipeline(sara)
    feed(again, dead if lost else still)
    again.reset()
    expected, found = feed(once, dead, 5.0), feed(again, dead, 5.0)
    assert np.any(expected.health & tl.Health.SENSOR_EXCLUDED)
    np.testing.assert_array_equal(expected.tau_ext, found.tau_ext)
    np.testing.assert_array_equal(expected.segment_wrench, found.segment_wrench)
    np.testing.assert_array_equal(expected.health, found.health)


def test_a_pipeline_begins_afresh_as_a_new_one(sara):
    still = at_rest(sara)
    touched = replace(still, wrench=still.wrench + np.array([0.0, 0.0, -30.0, 0.0, 0.0, 0.0]))
    used, new = tl.Pipeline(sara), tl.Pipeline(sara)
    feed(used, still)
    feed(used, touched, 1.0)
    count, afresh = len(used.events), used.afresh()
    assert count and not afresh.events
    for samples, start in ((still, 5.0), (touched, 6.0)):
        expected, found = feed(new, samples, start), feed(afresh, samples, start)
        np.testing.assert_array_equal(expected.tau_ext, found.tau_ext)
    assert [repr(event) for event in afresh.events] == [repr(event) for event in new.events]
    assert len(used.events) == count


@pytest.mark.parametrize("seed", range(3))
def test_a_grasped_body_is_weighed_in_three_seconds_of_motion(sara, seed):
    com = np.array([0.02, -0.01, 0.06])
    motion = free_motion(carrying(sara, 0.8, tuple(com)), seconds=3.0, seed=seed, noise=0.05)
    found = weigh_load(sara, [motion], LINK)
    assert found.mass == pytest.approx(0.8, abs=max(4 * found.mass_error, 0.005))
    assert found.mass_error < 0.02
    np.testing.assert_allclose(found.com, com, atol=0.005)


@pytest.mark.parametrize("seed", range(6))
def test_links_that_are_off_are_in_the_error_of_a_weighed_body(sara, seed):
    com = (0.02, -0.01, 0.06)
    wrong = perturbed(sara.mechanism, 0.015, np.random.default_rng(seed))
    empty = Robot(sara.description, wrong)
    held = carrying(empty, 0.8, com)
    found = weigh_load(sara, [free_motion(held, seconds=3.0, seed=seed, noise=0.05)], LINK)
    assert abs(found.mass - 0.8) < 4.0 * found.mass_error < 0.3
    with pytest.raises(InputError, match="no load on tool"):
        weigh_load(sara, [free_motion(empty, seconds=3.0, seed=seed, noise=0.05)], LINK)


def test_an_empty_gripper_has_no_load(sara):
    motion = free_motion(sara, seconds=3.0, noise=0.05)
    with pytest.raises(InputError, match="no load on tool"):
        weigh_load(sara, [motion], LINK)


def test_weighing_names_what_is_wrong(sara):
    motion = free_motion(sara, seconds=3.0)
    with pytest.raises(InputError, match="unknown link 'claw'"):
        weigh_load(sara, [motion], "claw")
    with pytest.raises(InputError, match="no load on tool"):
        weigh_load(sara, [], LINK)


def test_events_that_are_over_are_kept_only_as_far_as_asked(sara):
    pushes = [
        ScriptedContact(
            "tool", np.zeros(3), np.array([20.0, 0.0, 0.0]), Profile(0.5 + 0.4 * i, hold=0.1)
        )
        for i in range(9)
    ]
    samples = scripted(sara, pushes, 4.5, settings=Run(noise=SensorNoise(), rate=500.0)).samples
    every, bounded = (tl.Pipeline(sara, period=0.002) for _ in range(2))
    bounded.keep_events(2)
    for row in zip(samples.time, samples.q, samples.qd, samples.tau, samples.wrench, strict=True):
        every.update(*row)
        bounded.update(*row)
    assert len(every.events) >= 8
    kept = [event.as_json() for event in bounded.events]
    assert 2 <= len(kept) <= 4 and kept == [event.as_json() for event in every.events[-len(kept) :]]
    assert bounded.events == bounded.events


@pytest.mark.parametrize(
    "inertia",
    [(-1e-3, 0, 0, 1e-3, 0, 1e-3), (1e-3, 0, 0, 1e-3, 0, 3e-3), (1e-3, 2e-3, 0, 1e-3, 0, 1e-3)],
)
def test_a_load_that_no_body_has_is_refused(sara, inertia):
    pipeline = tl.Pipeline(sara)
    with pytest.raises(ValueError, match="inertia"):
        pipeline.set_load(LINK, 1.0, (0.0, 0.0, 0.05), inertia)
    assert not pipeline.robot.description.loads
