# SPDX-License-Identifier: Apache-2.0
"""The same estimator for every layout of sensors, and what must not matter to it."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from shapes import box, chain, measured, still, turned

import touchline as tl
from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.model.robot import Robot
from touchline.observer.observer import Observer
from touchline.trials.touches import TouchSampler, resting_signals

CUBE = box(0.2, 0.2, 0.2)
PLACE, PUSH = np.array([0.03, -0.05, 0.1]), np.array([4.0, 3.0, -20.0])
LAYOUTS = {
    "base": ((("base", "link0"),), "none", None),
    "base and joints": ((("base", "link0"),), "sensor", None),
    "wrist": ((("wrist", "link5"),), "none", ("wrist",)),
    "base and wrist": ((("base", "link0"), ("wrist", "link5")), "none", None),
    "in the chain": ((("base", "link0"), ("a", "link2"), ("b", "link4")), "sensor", None),
}


def located(robot, count, segments=None, seed=4):
    """Noise-free answers to pushes at random places, each with its touch."""
    skin, rng = Skin(robot), np.random.default_rng(seed)
    sampler = TouchSampler(skin, rng, segments, floor=-9.0)
    observer = Observer(robot)
    localizer = Localizer(observer, skin=skin)
    for _ in range(count):
        touch = sampler.sample(20.0)
        s = resting_signals(robot, touch.q, [(touch, 0.0)], 0.15, None)
        observer.reset()
        rows = observer.run(s.time, s.q, s.qd, s.tau, s.wrench).rows
        assert touch.patch.segment is not None
        estimate = observer.estimate(rows[-1])
        yield touch, localizer.locate(touch.patch.segment, touch.q, estimate)


def check(answers, share):
    """The place is among the explanations in all cases, and is the answer in a share of them."""
    right = []
    for touch, answer in answers:
        distances = [np.linalg.norm(c.position - touch.position) for c in answer.candidates]
        assert min(distances) < 1e-3
        right.append(distances[0] < 1e-3)
    assert np.mean(right) >= share


@pytest.mark.parametrize("layout", LAYOUTS)
def test_pushes_are_found_with_every_layout_that_has_a_wrench(layout):
    sensors, torque, segments = LAYOUTS[layout]
    robot = chain((0.3,) * 5, sensors=sensors, torque=torque)
    # A base sensor alone cannot tell which of the bodies on a line it is.
    check(located(robot, 40, segments), 0.85 if torque == "none" else 0.97)


@pytest.mark.parametrize("name", ["sara", "sara-full", "sara-handle-1axis"])
def test_pushes_are_found_on_the_arms_that_ship(name):
    robot = tl.load_robot(name)
    wrenches = tuple(segment for segment in robot.segment_names if segment != "root")
    check(located(robot, 25, wrenches), 0.95)


@settings(max_examples=25, deadline=None)
@given(st.tuples(*[st.floats(-3.0, 3.0)] * 3), st.tuples(*[st.floats(-1.0, 1.0)] * 3))
def test_the_answer_moves_with_the_frame(rpy, shift):
    shape = turned(CUBE, np.array(rpy), np.array(shift))
    T = shape.T_link_shape
    place, push = T[:3, :3] @ PLACE + T[:3, 3], T[:3, :3] @ PUSH
    observer, estimate, skin = measured(still(shape), [], [("body", place, push)], duration=0.15)
    answer = Localizer(observer, skin=skin).locate("base", [], estimate)
    np.testing.assert_allclose(answer.position, place, atol=1e-8)
    np.testing.assert_allclose(answer.force, push, atol=1e-5)


@settings(max_examples=15, deadline=None)
@given(st.floats(0.2, 20.0))
def test_force_is_linear_and_place_does_not_depend_on_it(scale):
    observer, estimate, skin = measured(
        still(CUBE), [], [("body", PLACE, scale * PUSH)], duration=0.15
    )
    answer = Localizer(observer, skin=skin).locate("base", [], estimate)
    np.testing.assert_allclose(answer.position, PLACE, atol=1e-8)
    np.testing.assert_allclose(answer.force, scale * PUSH, rtol=1e-5)


def test_the_order_of_the_description_does_not_matter():
    robot = chain((0.3,) * 4, sensors=(("base", "link0"), ("wrist", "link3")))
    d = robot.description
    other = Robot(
        replace(d, joints=d.joints[::-1], sensors=d.sensors[::-1]),
        robot.mechanism,
    )
    q, point = np.array([0.3, -0.8, 0.5, 0.9]), np.array([0.1, 0.04, 0.01])
    answers = []
    for r, qs in ((robot, q), (other, q[::-1])):
        place = r.places["link2"]
        T = r.poses(qs)[place.node] @ place.T_node_link
        load = [("link2", T[:3, :3] @ point + T[:3, 3], T[:3, :3] @ np.array([0.0, -20.0, 3.0]))]
        observer, estimate, skin = measured(r, qs, load, duration=0.15)
        answers.append(Localizer(observer, skin=skin).locate("base", qs, estimate))
    first, second = answers
    assert (first.link, first.status) == (second.link, second.status) == ("link2", "located")
    np.testing.assert_allclose(first.position, second.position, atol=1e-9)
    np.testing.assert_allclose(first.covariance, second.covariance, rtol=1e-6, atol=1e-15)
    assert first.chi2 == pytest.approx(second.chi2, rel=1e-6, abs=1e-9)
