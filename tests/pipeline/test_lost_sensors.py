# SPDX-License-Identifier: Apache-2.0
"""A force-torque sensor dies: the rest carries on, and what cannot be felt is said."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import exact_loads

import touchline as tl
from touchline.model.description import SensorDescription
from touchline.model.robot import Robot
from touchline.observer.samples import Samples
from touchline.trials.recordings import PUSHED, RELEASED, record

RATE = 1000.0
DEAD = 0.3  # s at which the sensor dies
PUSH = 0.6  # s at which the push begins; 5 / K is 50 ms
END = 1.2  # s


def ur5():
    """A UR5 with a base and a wrist sensor and six joint torques."""
    try:
        plain = tl.load_robot("ur5")
    except tl.InputError as error:
        pytest.skip(str(error))
    places = (("base", "shoulder_link"), ("wrist", "wrist_3_link"))
    sensors = tuple(SensorDescription(name, link) for name, link in places)
    noise = replace(
        plain.description.noise, sensors={s.name: (0.05,) * 3 + (0.01,) * 3 for s in sensors}
    )
    bandwidths = {s.name: 100.0 for s in sensors}
    joints = tuple(replace(joint, torque="sensor") for joint in plain.description.joints)
    description = replace(
        plain.description, sensors=sensors, noise=noise, bandwidth_sensors=bandwidths, joints=joints
    )
    return Robot(description, plain.mechanism)


ROBOTS = {
    "sara": lambda: tl.load_robot("sara"),
    "sara-full": lambda: tl.load_robot("sara-full"),
    "ur5": ur5,
}
_made = {}


def robot_named(name):
    if name not in _made:
        _made[name] = ROBOTS[name]()
    return _made[name]


def inboard(robot, node):
    path = []
    while node >= 0:
        path.append(robot.nodes[node])
        node = robot.nodes[node].parent
    return path


def pushed(robot, q, link, force, begin=PUSH, end=END, seed=0):
    """The arm stands at q; a force (3,) in world acts on the middle of a link from `begin` on."""
    time = np.arange(round(END * RATE)) / RATE
    many = np.tile(q, (len(time), 1))
    tau, wrench = exact_loads(robot, time, many, np.zeros_like(many))
    rng = np.random.default_rng(seed)
    tau = tau + rng.normal(0.0, 0.02, tau.shape)
    wrench = wrench + rng.normal(0.0, 0.02, wrench.shape)
    on = (time >= begin) & (time < end)
    point = middle(robot, q, link)
    moment = np.cross(point, force)
    nodes, poses = robot.nodes, robot.poses(q)
    for node in inboard(robot, robot.places[link].node):
        i = nodes.index(node)
        R, p = poses[i][:3, :3], poses[i][:3, 3]
        if node.coordinate >= 0:
            axis = R[:, 2]
            torque = node.multiplier * (axis @ (moment - np.cross(p, force)))
            tau[on, node.coordinate] -= torque
        if node.sensor in robot.sensor_names:
            s = robot.sensor_names.index(node.sensor)
            local = np.concatenate([R.T @ force, R.T @ (moment - np.cross(p, force))])
            wrench[on, s] -= local
    return Samples(time, many, np.zeros_like(many), tau, wrench)


def middle(robot, q, link):
    skin = tl.Skin(robot)
    patch = next(p for p in skin.patches if p.link == link)
    return (robot.T_world_links(q)[link] @ [*patch.surface.vertices.mean(axis=0), 1.0])[:3]


def run(pipeline, s):
    return pipeline.run(s.time, s.q, s.qd, s.tau, s.wrench)


def without(samples, sensor, begin=DEAD, end=END):
    wrench = samples.wrench.copy()
    wrench[(samples.time >= begin) & (samples.time < end), sensor] = np.nan
    return replace(samples, wrench=wrench)


def felt_links(robot, skin_of):
    return [p.link for p in tl.Skin(skin_of).patches if p.segment is not None]


CASES = [
    (name, k) for name, count in (("sara", 3), ("sara-full", 2), ("ur5", 2)) for k in range(count)
]


@pytest.mark.parametrize(("name", "dead"), CASES)
def test_a_push_is_felt_on_every_link_that_the_rest_can_feel(name, dead):
    from touchline.pipeline.stand_ins import robot_without

    robot = robot_named(name)
    q = np.linspace(0.3, 0.9, len(robot.joint_names))
    rng = np.random.default_rng(5)
    rest = robot_without(robot, [dead])
    whole, late, missed = tl.Pipeline(robot), [], []
    for link in felt_links(robot, rest):
        force = rng.normal(size=3)
        force *= 25.0 / np.linalg.norm(force)
        samples = pushed(robot, q, link, force)
        alone = tl.Pipeline(rest)
        left = np.delete(samples.wrench, dead, axis=1)
        alone.run(samples.time, samples.q, samples.qd, samples.tau, left)
        if not alone.events:
            continue  # this direction cannot be felt by what is left
        whole.reset()
        run(whole, samples)
        clean = min(event.detected for event in whole.events if event.detected >= PUSH)
        pipeline = tl.Pipeline(robot)
        run(pipeline, without(samples, dead))
        found = [event.detected for event in pipeline.events if event.detected >= PUSH]
        if not found:
            missed.append(link)
        elif min(found) > clean + 0.03:
            late.append((link, min(found) - clean))
        assert pipeline.lost == [robot.sensor_names[dead]]
        assert all(event.detected >= PUSH for event in pipeline.events), "an event of the fault"
    assert not missed and not late


@pytest.mark.parametrize(("name", "dead"), CASES)
def test_a_blind_segment_is_said_and_a_healthy_one_is_watched(name, dead):
    robot = robot_named(name)
    q = np.linspace(0.3, 0.9, len(robot.joint_names))
    link = felt_links(robot, robot)[-1]
    samples = pushed(robot, q, link, np.zeros(3))
    pipeline = tl.Pipeline(robot)
    run(pipeline, without(samples, dead))
    before, after = pipeline.watch[250], pipeline.watch[-1]
    assert np.all(before == 0), "all is watched while all sensors are there"
    g = robot.segment_names.index(robot.sensor_names[dead])
    assert after[g] != 0
    live = tl.Pipeline(robot)
    for i, x in enumerate(zip(*_columns(without(samples, dead)), strict=True)):
        result = live.update(*x)
        numbers = [list(tl.Watch).index(state) for state in result.watch]
        assert numbers == pipeline.watch[i].tolist()
    assert pipeline.events == [] and live.events == []


def _columns(s):
    return s.time, s.q, s.qd, s.tau, s.wrench


def test_the_root_sensor_of_an_arm_without_torques_leaves_it_blind():
    robot = robot_named("ur5")
    silent = tuple(replace(joint, torque="none") for joint in robot.description.joints)
    only = Robot(
        replace(robot.description, joints=silent, sensors=robot.description.sensors[:1]),
        robot.mechanism,
    )
    q = np.linspace(0.3, 0.9, 6)
    samples = pushed(only, q, felt_links(only, only)[-1], np.array([0.0, 0.0, -25.0]))
    pipeline = tl.Pipeline(only)
    run(pipeline, without(samples, 0))
    assert pipeline.events == [] and np.all(pipeline.watch[-1] == 2)
    # The joint inboard of the sensor has no torque: what it moves alone was never felt.
    assert dict(zip(only.segment_names, pipeline.watch[250], strict=True)) == {"base": 0, "root": 2}


def test_it_recovers_within_five_time_constants_of_the_sensor_s_return():
    robot = robot_named("sara")
    q = np.linspace(0.3, 0.9, 7)
    samples = pushed(robot, q, "link5", np.array([0.0, 15.0, -20.0]), begin=0.9)
    pipeline = tl.Pipeline(robot)
    run(pipeline, without(samples, 1, 0.3, 0.6))
    states = pipeline.watch
    assert np.all(states[604 + 51] == 0) and np.any(states[550] != 0)
    assert pipeline.lost == []
    assert len(pipeline.events) == 1 and 0.9 <= pipeline.events[0].detected < 0.93


def test_numbers_and_changes_of_events_are_one_story():
    robot = robot_named("sara")
    q = np.linspace(0.3, 0.9, 7)
    force = np.array([0.0, 15.0, -20.0])
    first = pushed(robot, q, "link5", force, begin=0.1, end=0.2)
    second = pushed(robot, q, "link5", force, begin=0.5, end=0.6)
    third = pushed(robot, q, "link5", force, begin=0.8, end=0.86)
    tau = first.tau + second.tau + third.tau - 2 * pushed(robot, q, "link5", 0 * force).tau
    wrench = first.wrench + second.wrench + third.wrench
    wrench -= 2 * pushed(robot, q, "link5", 0 * force).wrench
    samples = without(replace(first, tau=tau, wrench=wrench), 1, 0.3, 0.7)
    whole, live = tl.Pipeline(robot), tl.Pipeline(robot)
    run(whole, samples)
    told = []
    for x in zip(*_columns(samples), strict=True):
        told += [(c.happened, c.event.id) for c in live.update(*x).events]
    assert [event.id for event in whole.events] == [0, 1, 2]
    assert whole.events == live.events
    for number in range(3):
        own = [str(happened) for happened, i in told if i == number]
        assert own[0] == "began" and own[-1] == "ended" and own.count("began") == 1
        assert own.count("ended") == 1


@pytest.mark.parametrize("stamp", [None, 0.298, 0.2, np.nan], ids=["fine", "twice", "back", "none"])
@pytest.mark.parametrize("chunks", [1, 7, 64])
def test_a_recording_in_parts_gives_the_bits_of_single_samples(chunks, stamp):
    """Also where the whole robot has refused the sample before the loss."""
    robot = robot_named("sara")
    q = np.linspace(0.3, 0.9, 7)
    samples = without(pushed(robot, q, "link5", np.array([0.0, 15.0, -20.0])), 1, 0.3, 0.8)
    if stamp is not None:
        samples.time[299] = stamp
    live = tl.Pipeline(robot)
    single = [live.update(*x) for x in zip(*_columns(samples), strict=True)]
    parts = tl.Pipeline(robot)
    rows = [
        parts.run(*x)[0].rows
        for x in zip(*(np.array_split(c, chunks) for c in _columns(samples)), strict=True)
    ]
    np.testing.assert_array_equal(np.concatenate(rows), [r.estimate.rows for r in single])
    assert parts.events == live.events


def test_healthy_samples_are_the_whole_robot_s_to_the_last_bit(monkeypatch):
    robot = robot_named("sara")
    q = np.linspace(0.3, 0.9, 7)
    samples = pushed(robot, q, "link5", np.array([0.0, 15.0, -20.0]))
    ready = tl.Pipeline(robot)
    with monkeypatch.context() as patched:
        patched.setattr("touchline.pipeline.stand_ins.losses", lambda sensors: [])
        plain = tl.Pipeline(robot)
    np.testing.assert_array_equal(run(plain, samples)[0].rows, run(ready, samples)[0].rows)
    assert plain.events == ready.events


@pytest.mark.parametrize(("name", "dead"), [("sara", 1), ("sara", 2), ("sara-full", 1), ("ur5", 1)])
def test_a_contact_that_lasts_through_a_drop_out_stays_one_event(name, dead):
    robot = robot_named(name)
    q = np.linspace(0.3, 0.9, len(robot.joint_names))
    link = "forearm_link" if name == "ur5" else "link4"
    force = np.array([5.0, 15.0, -20.0])
    samples = pushed(robot, q, link, force, begin=0.3, end=0.95)
    pipeline = tl.Pipeline(robot)
    live = tl.Pipeline(robot)
    lossy = without(samples, dead, 0.5, 0.8)
    run(pipeline, lossy)
    told = []
    for x in zip(*_columns(lossy), strict=True):
        told += [str(c.happened) for c in live.update(*x).events]
    assert len(pipeline.events) == 1 and pipeline.events == live.events
    event = pipeline.events[0]
    assert 0.3 <= event.detected < 0.33 and 0.95 < event.cleared < 1.2
    assert told.count("began") == told.count("ended") == 1


def test_a_contact_that_ends_in_a_drop_out_is_over():
    robot = robot_named("sara")
    q = np.linspace(0.3, 0.9, 7)
    samples = pushed(robot, q, "link4", np.array([5.0, 15.0, -20.0]), begin=0.3, end=0.52)
    pipeline = tl.Pipeline(robot)
    run(pipeline, without(samples, 1, 0.5, 0.8))
    assert len(pipeline.events) == 1
    assert 0.5 < pipeline.events[0].cleared < 0.75


@pytest.fixture(scope="module")
def held():
    """A moving arm, 2 % off, of which an outer link is held for half a second."""
    return record(robot_named("sara"), 0)


def test_what_joint_torques_say_of_a_place_counts_only_until_the_sensor_is_back(held):
    """Their errors last: of many samples they would be sure of another link."""
    whole, pipeline = tl.Pipeline(held.robot), tl.Pipeline(held.robot)
    run(whole, held.samples)
    run(pipeline, without(held.samples, 0, PUSHED, PUSHED + 0.3))
    (healthy,), (event,) = whole.events, pipeline.events
    assert healthy.body == held.body
    assert event.status != "located" or event.body == held.body
    # While the sensor is lost a force is not known, which is no force of zero.
    assert np.linalg.norm(event.force - healthy.force) < 0.2 * np.linalg.norm(healthy.force)


def test_a_push_whose_sensor_is_lost_meanwhile_does_not_rest_there(held):
    """A sensor that is lost does not say that it carries nothing any more."""
    pipeline = tl.Pipeline(held.robot)
    lossy = without(held.samples, 0, PUSHED + 0.02, PUSHED + 0.3)
    _, detection = run(pipeline, lossy)
    assert all(event.cleared is not None for event in pipeline.events)
    assert (
        np.abs(detection.normalized[-200:]).mean(axis=0).max() < 0.7
    )  # nothing has become an offset


@pytest.mark.parametrize(("name", "dead"), CASES)
def test_a_push_in_the_very_sample_that_loses_a_sensor_is_felt_at_once(name, dead):
    robot = robot_named(name)
    q = np.linspace(0.3, 0.9, len(robot.joint_names))
    link = "forearm_link" if name == "ur5" else "link4"
    samples = pushed(robot, q, link, np.array([5.0, 15.0, -20.0]))
    whole, pipeline = tl.Pipeline(robot), tl.Pipeline(robot)
    run(whole, samples)
    run(pipeline, without(samples, dead, PUSH))
    (clean,), (event,) = whole.events, pipeline.events
    assert event.detected <= clean.detected + 0.005


@pytest.mark.parametrize("dead", [1, 2])
@pytest.mark.parametrize("lost", [PUSHED - 0.2, PUSHED + 0.2])
def test_who_steps_in_goes_on_with_what_was_filtered(held, dead, lost):
    """The oracle: the robot without the sensor, which has listened from the beginning."""
    from touchline.pipeline.stand_ins import robot_without

    s, rest = held.samples, robot_without(held.robot, [dead])
    alone = tl.Observer(rest)
    oracle = alone.run(s.time, s.q, s.qd, s.tau, np.delete(s.wrench, dead, axis=1))
    pipeline = tl.Pipeline(held.robot)
    estimate, _ = run(pipeline, without(s, dead, lost, np.inf))
    merged = held.robot.segment_names.index("base")  # inboard of both others
    told = s.time >= lost + 0.03  # it speaks after 2 / K, or as soon as it feels what was felt
    assert estimate.segment_settled[told, merged].all()
    same = rest.segment_names.index("base")
    np.testing.assert_allclose(
        estimate.segment_wrench[told, merged], oracle.segment_wrench[told, same], atol=1e-9
    )
    np.testing.assert_allclose(estimate.tau_ext[told], oracle.tau_ext[told], atol=1e-9)
    # A wrench turns with the arm: projected at one instant it leaves a ghost of |w| |F| / K.
    ghost = 0.5 * 25.0 / 100.0 * 1.0  # rad/s, N, rad/s, a lever of 1 m: [Nm]
    away = np.abs(estimate.segment_torque[told] - oracle.segment_torque[told])
    known = [joint.measured for joint in rest.description.joints]
    assert away[:, known].max() < ghost
    np.testing.assert_allclose(away[-500:, known], 0.0, atol=1e-9)


def test_an_event_keeps_the_place_that_it_had_when_there_were_more_sensors(held):
    whole, pipeline = tl.Pipeline(held.robot), tl.Pipeline(held.robot)
    run(whole, held.samples)
    run(pipeline, without(held.samples, 0, RELEASED - 0.05, np.inf))
    (healthy,), (event,) = whole.events, pipeline.events
    assert healthy.status == event.status == "located" and healthy.level == event.level
    assert (event.segment, event.body) == (healthy.segment, healthy.body)
    assert event.detected == healthy.detected and event.force_peak == healthy.force_peak
    np.testing.assert_allclose(event.position_link, healthy.position_link, atol=0.001)


@pytest.mark.parametrize("dead", [0, 1, 2])
def test_single_lost_packets_take_no_contact_away(held, dead):
    s = held.samples
    wrench = s.wrench.copy()
    wrench[::10, dead] = np.nan
    pipeline = tl.Pipeline(held.robot)
    told, felt = [], []
    for x in zip(s.time, s.q, s.qd, s.tau, wrench, strict=True):
        result = pipeline.update(*x)
        told += [str(change.happened) for change in result.events]
        felt.append(len(result.contacts) > 0)
    (event,) = pipeline.events
    assert told.count("began") == told.count("ended") == 1
    lasts = (s.time >= event.detected) & (s.time < RELEASED)
    assert np.all(np.array(felt)[lasts])
