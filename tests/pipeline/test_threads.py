# SPDX-License-Identifier: Apache-2.0
"""Two threads on one object wait for each other; `run` lets other threads go on."""

import threading
import time as clock
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import touchline as tl
from touchline.detector.detector import Detector
from touchline.simulation.scenario import three_touches


@pytest.fixture(scope="module")
def touched():
    robot = tl.load_robot("sara")
    return robot, three_touches(robot, speed=0.5, seconds=0.3).samples


def hammer(call, threads=4):
    """The same call from several threads at once; an exception in any is raised."""
    begin = threading.Barrier(threads)

    def work(number):
        begin.wait()
        return call(number)

    with ThreadPoolExecutor(threads) as pool:
        return list(pool.map(work, range(threads)))


def detector(robot):
    return Detector(tl.Observer(robot))


@pytest.mark.parametrize("make", [tl.Observer, tl.Pipeline, detector])
def test_threads_that_share_an_object_take_turns(touched, make):
    robot, s = touched
    shared = make(robot)
    signals = (s.time, s.q, s.qd, s.tau, s.wrench)

    def use(number):
        for _ in range(3):
            if number % 2:
                shared.run(*signals)
            else:
                for sample in zip(*(x[:200] for x in signals), strict=True):
                    shared.update(*sample)
            if isinstance(shared, tl.Pipeline):
                assert all(isinstance(event, tl.Event) for event in shared.events)
        return number

    assert hammer(use) == [0, 1, 2, 3]


def test_poses_of_one_robot_are_right_in_every_thread(touched):
    robot, s = touched
    expected = [robot.poses(q) for q in s.q[::20]]

    def use(number):
        for q, poses in zip(s.q[::20], expected, strict=True):
            np.testing.assert_array_equal(robot.poses(q), poses)

    hammer(use)


def test_one_pipeline_per_thread_says_what_it_says_alone(touched):
    robot, s = touched
    signals = (s.time, s.q, s.qd, s.tau, s.wrench)
    alone = tl.Pipeline(robot)
    alone.run(*signals)
    pipelines = [tl.Pipeline(robot, skin=alone.skin) for _ in range(4)]
    hammer(lambda i: pipelines[i].run(*signals))
    for pipeline in pipelines:
        np.testing.assert_array_equal(pipeline.contacts.numbers, alone.contacts.numbers)
        assert pipeline.events == alone.events


def test_other_threads_go_on_while_a_recording_is_read(touched):
    robot, s = touched
    pipeline = tl.Pipeline(robot)
    signals = [np.concatenate([x] * 20) for x in (s.q, s.qd, s.tau, s.wrench)]
    time = np.arange(20 * len(s)) * 1e-3
    counted, done = [0], threading.Event()

    def count():
        while not done.is_set():
            counted[0] += 1
            clock.sleep(0)

    thread = threading.Thread(target=count)
    thread.start()
    before = counted[0]
    pipeline.run(time, *signals)
    during = counted[0] - before
    done.set()
    thread.join()
    assert during > 20
