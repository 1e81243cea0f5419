# SPDX-License-Identifier: Apache-2.0
"""What a hand may close around is pulled and twisted, not only pushed."""

import numpy as np
import pytest
from shapes import box, chain, measured, still

from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact
from touchline.trials.touches import Touch, resting_signals

CUBE = box(0.2, 0.2, 0.2)
PLACE, PULL = np.array([0.03, -0.05, 0.1]), np.array([4.0, 3.0, 20.0])
ALONG = np.array([20.0, 0.0, -1.0])  # outside any friction cone
Q = np.array([0.3, 0.9, -0.4])


def locate(robot, q, loads):
    observer, estimate, skin = measured(robot, q, loads)
    return Localizer(observer, skin=skin).locate("base", q, estimate)


@pytest.mark.parametrize("force", [PULL, ALONG])
def test_a_pull_and_a_drag_are_among_the_explanations_only_of_what_can_be_grasped(force):
    for graspable in ((), ("body",)):
        answer = locate(still(CUBE, graspable), [], [("body", PLACE, force)])
        nearest = min(np.linalg.norm(c.position - PLACE) for c in answer.candidates)
        placed = answer.status in ("located", "ambiguous")
        assert (placed and nearest < 1e-6) == bool(graspable)


def twist(link, point, moment):
    """Two opposite forces at one point's sides: a couple along z."""
    arm, push = np.array([0.02, 0.0, 0.0]), np.array([0.0, moment / 0.04, 0.0])
    return [(link, point + arm, push), (link, point - arm, -push)]


@pytest.mark.parametrize("graspable", [(), ("link3",)])
def test_a_twist_of_what_can_be_grasped_is_a_wrench_beside_joint_torques_too(graspable):
    robot = chain(graspable=graspable)
    point = robot.poses(Q)[robot.places["link3"].node][:3, 3]
    loads = [("link3", point, np.array([0.0, 0.0, 15.0])), *twist("link3", point, 2.0)]
    answer = locate(robot, Q, loads)
    assert answer.status == ("wrench_only" if graspable else "not_separable")
    assert answer.position is None
    np.testing.assert_allclose(answer.force, [0.0, 0.0, 15.0], atol=1e-6)


def test_a_push_on_what_can_be_grasped_is_located_beside_its_exit():
    answer = locate(still(CUBE, ("body",)), [], [("body", PLACE, -PULL)])
    assert answer.status == "ambiguous"  # as a push on top or a pull from below
    assert {round(float(c.position[2]), 6) for c in answer.candidates} == {0.1, -0.1}


def test_the_pipeline_tells_the_moment_of_a_twist():
    """2 Nm about z and a pull of 15 N along it, on what can be grasped, in the flow of samples."""
    robot = chain(sensors=(("base", "link0"), ("tool", "link3")), graspable=("link3",))
    patch = next(patch for patch in Skin(robot).patches if patch.link == "link3")
    point = robot.poses(Q)[patch.node][:3, 3]
    loads = [("link3", point, np.array([0.0, 0.0, 15.0])), *twist("link3", point, 2.0)]
    touches = [(Touch(Q, patch, at, np.zeros(3), force), 0.3) for _, at, force in loads]
    signals = resting_signals(robot, Q, touches, 0.45, None)
    pipeline = Pipeline(robot)
    for sample in zip(*vars(signals).values(), strict=True):
        result = pipeline.update(*sample)
    (contact,) = result.contacts
    assert (contact.segment, contact.status, contact.position) == ("tool", "wrench_only", None)
    assert contact.line is not None
    np.testing.assert_allclose(contact.line[0], [*point[:2], 0.0], atol=1e-4)
    assert contact.moment == pytest.approx(2.0, abs=1e-4)
    assert contact.size == pytest.approx(15.0, abs=1e-4)


def test_a_contact_tells_the_line_and_the_moment_of_its_wrench():
    point, force = np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, -10.0])
    wrench = np.concatenate([force, np.cross(point, force) + [0.0, 0.0, 1.5]])
    contact = Contact("handle", 0, "contact", wrench=wrench)
    assert contact.line is not None
    np.testing.assert_allclose(contact.line[0], [0.1, 0.2, 0.0], atol=1e-12)
    np.testing.assert_allclose(contact.line[1], [0.0, 0.0, -1.0])
    assert contact.moment == pytest.approx(-1.5)
    assert Contact("root", 0, "contact").line is None
    assert Contact("root", 0, "contact").moment is None
