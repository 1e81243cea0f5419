# SPDX-License-Identifier: Apache-2.0
"""Contacts on simple shapes and on an arm, at rest, exactly known."""

import numpy as np
import pytest
from shapes import BODY, box, chain, describe, measured, still, turned

import touchline as tl
from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.model.mechanism import Link, Mechanism
from touchline.observer.observer import Observer
from touchline.trials.touches import TouchSampler, resting_signals


def locate(robot, q, loads, segment="base", rng=None, **options):
    observer, estimate, skin = measured(robot, np.asarray(q, float), loads, rng)
    return Localizer(observer, skin=skin, **options).locate(segment, q, estimate)


CUBE = box(0.2, 0.2, 0.2)
CORNER = np.array([0.03, -0.05, 0.1])  # on top
PUSH = np.array([4.0, 3.0, -20.0])


def test_a_push_on_a_box_is_found_exactly_with_its_covariance_on_the_surface():
    answer = locate(still(CUBE), [], [("body", CORNER, PUSH)])
    assert (answer.status, answer.link, answer.body) == ("located", "body", "body")
    np.testing.assert_allclose(answer.position, CORNER, atol=1e-9)
    np.testing.assert_allclose(answer.force, PUSH, atol=1e-9)
    assert answer.body_probability == pytest.approx(1.0)
    assert abs(answer.pitch) < 1e-6
    assert answer.covariance[2, 2] == pytest.approx(0.0, abs=1e-12)
    assert (np.linalg.eigvalsh(answer.covariance)[1:] > 1e-9).all()


@pytest.mark.parametrize("scale", [0.2, 1.0, 10.0])
def test_the_place_does_not_depend_on_how_hard_the_push_is(scale):
    answer = locate(still(CUBE), [], [("body", CORNER, scale * PUSH)])
    np.testing.assert_allclose(answer.position, CORNER, atol=1e-9)
    spread = np.sqrt(np.trace(answer.covariance))
    unit = locate(still(CUBE), [], [("body", CORNER, PUSH)])
    assert spread == pytest.approx(np.sqrt(np.trace(unit.covariance)) / scale, rel=0.02)


def test_the_place_turns_with_the_frame():
    rpy, shift = np.array([0.4, -1.1, 2.0]), np.array([0.5, -0.3, 0.2])
    shape = turned(CUBE, rpy, shift)
    T = shape.T_link_shape
    moved = locate(still(shape), [], [("body", T[:3, :3] @ CORNER + shift, T[:3, :3] @ PUSH)])
    np.testing.assert_allclose(moved.position, T[:3, :3] @ CORNER + shift, atol=1e-9)
    assert moved.status == "located"


def test_the_scatter_of_answers_is_what_their_covariance_says():
    robot, rng = still(CUBE), np.random.default_rng(3)
    answers = [locate(robot, [], [("body", CORNER, PUSH)], rng=rng) for _ in range(150)]
    errors = np.array([a.position - CORNER for a in answers])[:, :2]
    covariance = answers[0].covariance[:2, :2]
    squares = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(covariance), errors)
    assert squares.mean() == pytest.approx(2.0, abs=0.5)
    assert {a.status for a in answers} == {"located"}


def test_a_pull_is_no_push_elsewhere():
    """The line of a pull enters the far side, where it is a push: there is no telling these."""
    answer = locate(still(CUBE), [], [("body", CORNER, -PUSH)])
    assert answer.position[2] == pytest.approx(-0.1)


def test_a_tool_that_is_twisted_gives_its_whole_wrench_and_no_point():
    push = [("body", CORNER, PUSH), ("body", [0.1, 0.0, 0.0], [0.0, 5.0, 0.0])]
    push += [("body", [-0.1, 0.0, 0.0], [0.0, -5.0, 0.0])]  # a couple of 1 Nm about z
    answer = locate(still(CUBE), [], push)
    assert answer.status == "wrench_only"
    assert answer.position is None and answer.link is None
    assert abs(answer.pitch) > 50
    np.testing.assert_allclose(answer.force, PUSH, atol=1e-6)


def test_a_feeble_force_has_no_place():
    answer = locate(still(CUBE), [], [("body", CORNER, 0.005 * PUSH)])
    assert answer.status == "wrench_only"
    assert answer.position is None


def two_blocks():
    """One body of two blocks in a row: a line may enter both."""
    shapes = (box(0.1, 0.1, 0.1), box(0.1, 0.1, 0.1, at=(0.25, 0.0, 0.0)))
    link = Link("body", BODY, shapes)
    return describe(Mechanism("two", "body", {"body": link}, {}, np.zeros(3)), [("base", "body")])


@pytest.mark.parametrize("entry", [-0.05, 0.2])
def test_two_entries_into_one_body_stay_ambiguous(entry):
    point = np.array([entry, 0.01, 0.0])
    answer = locate(two_blocks(), [], [("body", point, [20.0, 0.0, 0.0])])
    assert answer.status == "ambiguous"
    assert len(answer.candidates) == 2
    assert sum(c.probability for c in answer.candidates) == pytest.approx(1.0)
    assert answer.body_probability == pytest.approx(1.0)
    distances = [np.linalg.norm(c.position - point) for c in answer.candidates]
    assert min(distances) < 1e-9 and max(distances) > 0.2


@pytest.mark.parametrize("beyond", [-2e-4, 2e-4])
def test_a_line_that_passes_an_edge_within_the_noise_may_have_met_it(beyond):
    """A small block before a wall, pushed near its edge: the line may just miss it."""
    shapes = (box(0.1, 0.1, 0.1), box(0.1, 0.4, 0.4, at=(0.3, 0.0, 0.0)))
    mechanism = Mechanism("wall", "body", {"body": Link("body", BODY, shapes)}, {}, np.zeros(3))
    robot = describe(mechanism, [("base", "body")])
    point = np.array([-0.05, 0.05 + beyond, 0.0])
    answer = locate(robot, [], [("body", point, [20.0, 0.0, 0.0])])
    assert answer.status == "ambiguous"
    assert min(np.linalg.norm(c.position - point) for c in answer.candidates) < 5e-4
    assert max(c.position[0] for c in answer.candidates) == pytest.approx(0.25)


def test_joint_rows_tell_which_of_two_links_is_touched():
    robot = chain((0.3, 0.3, 0.3))
    q = np.array([0.0, 2.6, 2.6])  # folded: the outer links lie beside the inner ones
    point, force, link = crossing_of_two(robot, Skin(robot), q)
    answer = locate(robot, q, [(link, point, force)])
    wrong = locate(robot, q, [(link, point, force)], rule="paper")
    assert answer.status == "located"
    assert answer.link == link
    np.testing.assert_allclose(answer.position, point, atol=1e-6)
    assert wrong.link != link


def crossing_of_two(robot, skin, q):
    """A push on a link whose line enters another link first."""
    rng = np.random.default_rng(0)
    sampler = TouchSampler(skin, rng, clearance=0.005, floor=-1.0)
    while True:
        touch = sampler.sample(20.0, q)
        entries = [c for c in skin.crossings(q, touch.position, touch.force) if c.entry]
        if entries[0].link != touch.patch.link:
            return touch.position, touch.force, touch.patch.link


def test_the_paper_rule_answers_the_wrong_link_where_the_likelihood_does_not():
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    observer = Observer(robot)
    ours = Localizer(observer, skin=skin)
    paper = Localizer(observer, skin=skin, rule="paper")
    sampler = TouchSampler(skin, np.random.default_rng(8), segments=("base",))
    right = np.zeros(2, int)
    confident_and_wrong = 0
    for _ in range(150):
        touch = sampler.sample(20.0)
        s = resting_signals(robot, touch.q, [(touch, 0.0)], 0.1, None)
        observer.reset()
        rows = observer.run(s.time, s.q, s.qd, s.tau, s.wrench).rows
        estimate = observer.estimate(rows[-1])
        answers = [x.locate("base", touch.q, estimate) for x in (ours, paper)]
        right += [answer.body == touch.patch.body for answer in answers]
        far = np.linalg.norm(answers[0].position - touch.position) > 1e-3
        confident_and_wrong += far and answers[0].status == "located"
    assert right[0] >= 148
    assert right[1] <= 146
    assert confident_and_wrong == 0


def test_two_pushes_on_two_bodies_never_give_one_confident_point():
    """On one body two pushes may add up to what one would do; on two the rows tell."""
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    observer = Observer(robot)
    localizer = Localizer(observer, skin=skin)
    rng = np.random.default_rng(12)
    sampler = TouchSampler(skin, rng, segments=("base",))
    statuses = {True: [], False: []}
    for _ in range(100):
        first = sampler.sample(20.0)
        second = sampler.sample(20.0, first.q)
        s = resting_signals(robot, first.q, [(first, 0.0), (second, 0.0)], 0.1, rng)
        observer.reset()
        rows = observer.run(s.time, s.q, s.qd, s.tau, s.wrench).rows
        answer = localizer.locate("base", first.q, observer.estimate(rows[-1]))
        statuses[first.patch.body == second.patch.body].append(answer.status)
    apart, together = statuses[False], statuses[True]
    assert len(apart) > 70
    assert set(apart) == {"not_separable"}
    assert together.count("not_separable") >= 0.8 * len(together)


def test_joint_torques_alone_name_the_link_of_an_exact_push():
    robot = chain((0.3, 0.3, 0.3, 0.3, 0.3, 0.3, 0.3), sensors=())
    rng = np.random.default_rng(2)
    skin = Skin(robot)
    sampler = TouchSampler(skin, rng, floor=-9.0)
    hits = included = 0
    for _ in range(40):
        touch = sampler.sample(20.0)
        observer, estimate, skin = measured(
            robot, touch.q, [(touch.patch.link, touch.position, touch.force)]
        )
        answer = Localizer(observer, skin=skin, torque_error=0.0).locate("root", touch.q, estimate)
        bodies = {c.body for c in answer.candidates if c.probability > 0.01}
        included += touch.patch.body in bodies
        hits += answer.body == touch.patch.body
    assert included >= 38
    assert hits >= 30


def test_an_unknown_rule_is_refused():
    with pytest.raises(ValueError, match="allowed: likelihood, paper"):
        Localizer(Observer(still(CUBE)), rule="first")
