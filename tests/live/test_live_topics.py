# SPDX-License-Identifier: Apache-2.0
"""The merging of unsynchronised messages and what is published, in native threads, without ROS."""

import json
import time

import numpy as np
import pytest
from fake_rcl import JOINT_STATE, STORE, WRENCH, FakeRcl, joint_state, until, wrench
from live_arms import pushed, write_arm

import touchline as tl
from touchline.live.ros import make_reader, missing_joints, sample_of
from touchline.logs.naming import parse_naming
from touchline.model.robot import load_robot
from touchline.native import core

JOINTS, WRIST = 1, 2  # topics
WAIT = 0.5e-3  # s; half of what a joint state waits for its wrenches
LOG = (
    "log:\n  joint_names: {joint1: a1}\n  tau: {column: 'x.{joint}', factor: 0.001}\n"
    "  sensors: {wrist: {fx: {column: w, factor: -1.0}}}\n"
)


class Merged:
    """Messages go in, samples come out."""

    def __init__(self, folder, extra=LOG, joints=2):
        self.robot, self.topics = load_robot(write_arm(folder, joints, extra=extra)), FakeRcl()
        self.naming = parse_naming(self.robot.description)
        self.reader = make_reader(
            self.robot.description, self.naming, self.topics.rcl, [JOINTS, WRIST]
        )

    def state(self, at, names=("joint2", "spare", "a1"), lost=0):
        signals = ([2.0, 9.0, 1.0], [0.2, 0.9, 0.1], [2e3, 9e3, 1e3])
        self.topics.send(JOINTS, joint_state(at, names, *signals), lost)

    def wrench(self, at, values=(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)):
        self.topics.send(WRIST, wrench(at, values))

    def next(self):
        """The next sample."""
        self.reader.wait(2.0)
        found = self.reader.samples()
        assert len(found) == 1
        return sample_of(found[0], self.robot)

    def noted(self, count):
        """The next notes of what came."""
        notes = []
        until(lambda: notes.extend(self.reader.notes()) or len(notes) >= count)
        return notes


@pytest.fixture
def merged(tmp_path):
    made = Merged(tmp_path)
    yield made
    made.reader.stop()


def test_names_and_factors_are_those_of_the_description(merged):
    merged.wrench(0.9995)
    assert merged.noted(1)[0][0] == 1
    merged.state(1.0)
    sample = merged.next()
    assert sample.q.tolist() == [1.0, 2.0] and sample.qd.tolist() == [0.1, 0.2]
    assert np.allclose(sample.tau, [1.0, 2.0])
    assert sample.wrench[0].tolist() == [-1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    assert sample.ages[0] == pytest.approx(0.0005) and sample.sequence == 0


def test_the_last_wrench_counts_until_it_is_too_old(merged):
    for i in range(10):
        merged.wrench(0.002 * i + 1.0)
        merged.noted(1)
        merged.state(0.002 * i + 1.001)
        assert np.isfinite(merged.next().wrench).all()
        merged.noted(1)
    merged.state(1.018 + 0.009)
    assert np.isfinite(merged.next().wrench).all()
    merged.state(1.018 + 0.011)
    assert np.isnan(merged.next().wrench).all()


def test_a_wrench_that_comes_late_does_not_replace_a_newer_one(merged):
    merged.wrench(1.000)
    merged.wrench(0.998, [9.0] * 6)
    merged.noted(2)
    merged.state(1.001)
    assert merged.next().wrench[0, 1] == 2.0


def test_joint_states_wait_for_wrenches_of_their_own_stamp(merged):
    fresh = []
    for i in range(40):
        at, begun = 1.0 + 0.01 * i, time.monotonic()
        merged.state(at)  # first the joint state, then at once its wrench
        merged.wrench(at)
        own = merged.next().ages[0] == 0.0
        # A busy machine may hold up the test, or the reader: then its wait ends before it looks.
        in_time = time.monotonic() - begun < 2 * WAIT
        if in_time and i >= 5:  # it has to be seen first that they come so
            fresh.append(own)
        merged.noted(2)
    assert fresh and all(fresh)


def test_what_the_publisher_counted_and_did_not_come_is_lost(merged):
    merged.state(1.0)
    merged.state(1.003, lost=2)
    notes = merged.noted(2)
    assert [note[4] for note in notes] == [0, 2]
    found = [sample_of(x, merged.robot) for x in merged.reader.samples()]
    assert [sample.sequence for sample in found] == [0, 3]


def test_a_state_without_all_joints_makes_no_sample(merged):
    merged.state(1.0, ("joint2", "spare", "b"))
    merged.state(1.1)
    assert merged.next().time == 1.1
    for i in range(100):  # a gripper on the same topic
        merged.state(1.2 + i, ("f1", "f2", "f3"))
    merged.state(200.0)
    assert merged.next().time == 200.0


def test_joints_that_never_come_are_named(tmp_path):
    merged = Merged(tmp_path, extra="")
    for i in range(30):
        merged.state(0.1 * i + 1.0)
    assert until(lambda: merged.reader.incomplete()[0] == 30)
    line = missing_joints(merged.naming, merged.reader.incomplete()[1])
    assert "no joint 'joint1'" in line and "joint_names" in line
    merged.reader.stop()


def test_damaged_messages_cost_only_themselves(merged):
    whole = joint_state(1.0, ["a1", "joint2"], [1.0, 2.0], [0.0, 0.0], [0.0, 0.0])
    for end in range(0, len(whole), 7):
        merged.topics.send(JOINTS, whole[:end])
        merged.topics.send(WRIST, wrench(1.0, [0.0] * 6)[: end // 3])
    merged.state(2.0)
    assert merged.next().time == 2.0


def test_an_attached_runner_takes_what_waits_and_what_comes(merged):
    pipeline = tl.Pipeline(merged.robot, period=0.002)
    for i in range(5):
        merged.state(1.0 + 0.002 * i)
    merged.noted(5)
    runner = pipeline.beside(64)
    merged.reader.attach(runner)
    for i in range(5, 10):
        merged.state(1.0 + 0.002 * i)
    merged.state(1.0)  # again: refused
    assert until(lambda: runner.taken == 10) and until(lambda: runner.refused == 1)
    assert merged.reader.samples() == []
    runner.stop()


@pytest.fixture(scope="module")
def published(tmp_path_factory):
    """What is felt of a push, and what was published of it."""
    robot = load_robot(write_arm(tmp_path_factory.mktemp("arm"), 6))
    samples, topics = pushed(robot, seconds=2.0, begin=0.8), FakeRcl()
    pipeline = tl.Pipeline(robot, period=0.002)

    def make(native):
        return core.TopicWriter(native, "world", topics.rcl.publish, 5, 6, [(7, 0)])

    writer = pipeline.writer(make)
    assert writer is not None
    writer.set_rate(1e9)  # each sample
    rows = zip(samples.time, samples.q, samples.qd, samples.tau, samples.wrench, strict=True)
    results = [pipeline.update(*row) for row in rows]
    assert pipeline.writer(None) is None
    pipeline.update(3.0, *(x[-1] for x in (samples.q, samples.qd, samples.tau, samples.wrench)))
    assert writer.published == len(results) and writer.failed == 0
    return robot, samples, results, topics.published


def text_of(data):
    return STORE.deserialize_cdr(data, "std_msgs/msg/String").data


def test_contacts_are_published_with_the_keys_of_the_table(published):
    robot, samples, results, sent = published
    told = [json.loads(text_of(data)) for topic, data in sent if topic == 5]
    assert len(told) == len(results) and any(result.contacts for result in results)
    for at, result, one in zip(samples.time, results, told, strict=True):
        assert one["time"] == at and one["health"] == int(result.health)
        assert one["contacts"] == [
            {
                "event": c.event,
                "segment": c.segment,
                "level": c.level,
                "status": c.status,
                "link": c.link,
                "body": c.body,
                "body_probability": c.body_probability,
                "position": plain(c.position),
                "position_std": c.position_std,
                "covariance": plain(c.covariance),
                "force": plain(c.force),
                "candidates": [
                    {"link": x.link, "probability": x.probability, "position": plain(x.position)}
                    for x in c.candidates
                ],
            }
            for c in result.contacts
        ]


def plain(values):
    return None if values is None else values.tolist()


def test_torques_and_wrenches_are_published_as_estimated(published):
    robot, samples, results, sent = published
    torques = [STORE.deserialize_cdr(d, JOINT_STATE) for topic, d in sent if topic == 6]
    wrenches = [STORE.deserialize_cdr(d, WRENCH) for topic, d in sent if topic == 7]
    assert len(torques) == len(wrenches) == len(results)
    for at, result, torque, load in zip(samples.time, results, torques, wrenches, strict=True):
        stamp = torque.header.stamp
        assert stamp.sec + stamp.nanosec * 1e-9 == pytest.approx(at, abs=1e-9)
        assert torque.name == list(robot.joint_names)
        assert np.array_equal(torque.effort, result.estimate.tau_ext, equal_nan=True)
        assert load.header.frame_id == "world"
        force, moment = load.wrench.force, load.wrench.torque
        values = [force.x, force.y, force.z, moment.x, moment.y, moment.z]
        assert np.array_equal(values, result.estimate.segment_wrench[0], equal_nan=True)


def test_the_rate_of_what_is_published_is_bounded(tmp_path):
    robot, topics = load_robot(write_arm(tmp_path, 6)), FakeRcl()
    samples = pushed(robot, seconds=0.4, begin=1e3)
    pipeline = tl.Pipeline(robot, period=0.002)
    writer = pipeline.writer(
        lambda native: core.TopicWriter(native, "world", topics.rcl.publish, 5, 6, [])
    )
    writer.set_rate(1.0)
    for row in zip(samples.time, samples.q, samples.qd, samples.tau, samples.wrench, strict=True):
        pipeline.update(*row)
    assert 1 <= writer.published <= 3 and len(topics.published) == 2 * writer.published
