# SPDX-License-Identifier: Apache-2.0
"""Contacts that begin at the same instant: how many at least, and what the equations leave open."""

import numpy as np
import pytest
from shapes import chain

from touchline.localizer.skin import Skin
from touchline.pipeline.pipeline import Pipeline
from touchline.result.contact import Contact, least_contacts
from touchline.trials.touches import Touch, resting_signals

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5])
ONSET = 0.06
# In the frame of the link: place and force of pushes on boxes 8 cm thick.
PUSHES = {
    "link1": ([0.10, 0.02, 0.04], [2.0, 3.0, -14.0]),
    "link2": ([0.13, 0.04, 0.01], [2.0, -18.0, 3.0]),
    "link3": ([0.20, -0.04, 0.01], [-3.0, 16.0, 2.0]),
    "link4": ([0.10, -0.01, -0.04], [-1.0, 2.0, 15.0]),
    "link5": ([0.18, 0.04, -0.01], [1.0, -13.0, -2.0]),
    "link6": ([0.15, 0.02, 0.04], [3.0, 1.0, -12.0]),
}


@pytest.fixture(scope="module")
def arm():
    robot = chain((0.3,) * 6)
    return robot, Skin(robot)


def follow(arm, links, duration=0.2, work=None, period=1e-3):
    """The contacts after every sample, of pushes on links that all begin at `ONSET`.

    `work`: units of the search in each second.
    """
    robot, skin = arm
    touches = []
    for link in links:
        patch = next(patch for patch in skin.patches if patch.link == link)
        T = robot.T_world_links(Q)[link]
        place, force = (np.array(values) for values in PUSHES[link])
        position = T[:3, :3] @ place + T[:3, 3]
        touches.append(Touch(Q, patch, position, np.zeros(3), T[:3, :3] @ force))
    s = resting_signals(robot, Q, [(touch, ONSET) for touch in touches], duration, None, period)
    tuning = {} if work is None else {"localizer.pair_work": work}
    pipeline = Pipeline(robot, period=period, skin=skin, torque_error=0.0, tuning=tuning)
    said = [
        pipeline.update(*x).contacts for x in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True)
    ]
    return touches, said


def named(contact, touches):
    """Is each of the touches in a part of its link that is named?"""
    return [
        any(
            k.link == touch.patch.link and np.linalg.norm(k.position - touch.position) < k.radius
            for k in contact.candidates
        )
        for touch in touches
    ]


def area(contact):
    return sum(k.radius**2 for k in contact.candidates)


def test_one_contact_leaves_nothing_open(arm):
    _, said = follow(arm, ["link4"])
    (contact,) = said[-1]
    assert (contact.status, contact.at_least, contact.may_be_more) == ("located", 1, False)


def test_ten_equations_for_two_contacts_leave_none_over(arm):
    _, said = follow(arm, ["link2", "link6"])
    assert len(said[-1]) == 2
    for contact in said[-1]:
        assert (contact.rank, contact.unknowns) == (10, 10)
        assert contact.at_least == 1 and contact.may_be_more
        assert contact.position is not None


def test_eleven_equations_speak_against_a_third(arm):
    _, said = follow(arm, ["link1", "link6"])
    assert len(said[-1]) == 2
    for contact in said[-1]:
        assert contact.rank is None and not contact.may_be_more


@pytest.mark.parametrize("links", [("link2", "link4"), ("link3", "link4"), ("link4", "link6")])
def test_the_set_of_a_pair_is_narrowed_while_it_lasts(arm, links):
    touches, said = follow(arm, links)
    first = next(contacts[0] for contacts in said if contacts and contacts[0].candidates)
    (last,) = said[-1]
    assert (last.status, last.at_least, last.may_be_more) == ("not_separable", 2, True)
    assert last.unknowns == 10 and 6 < (last.rank or 0) < 10
    assert all(named(last, touches))
    assert area(last) < 0.6 * area(first)


def test_an_answer_says_while_a_search_still_runs(arm):
    _, said = follow(arm, ["link2", "link4"])
    course = [contacts[0].searching for contacts in said if contacts]
    done = course.index(False)
    assert done > 1 and not any(course[done:])
    narrow = [contacts[0].candidates for contacts in said if contacts]
    assert narrow[0] == () and len(narrow[done]) > 0


def test_less_work_in_a_sample_gives_the_same_places_later(arm):
    begun, places = [], []
    for work in (1_250_000, 1_000_000_000):
        _, said = follow(arm, ["link2", "link6"], work=work)
        begun.append(next(i for i, contacts in enumerate(said) if len(contacts) == 2))
        places.append(np.array([contact.position for contact in said[-1]]))
    assert begun[0] > begun[1] + 2
    np.testing.assert_allclose(*places, atol=2e-4)


def test_a_search_takes_as_long_at_any_sample_rate(arm):
    ends = []
    for period in (1e-3, 2.5e-4):
        _, said = follow(arm, ["link2", "link4"], period=period)
        searching = [any(contact.searching for contact in contacts) for contacts in said]
        ends.append(period * (len(said) - searching[::-1].index(True)) - ONSET)
    assert 0.005 < ends[0] < 0.1
    assert abs(ends[1] - ends[0]) < 0.3 * ends[0]


def test_a_pair_that_is_told_apart_is_searched_no_more(arm):
    _, said = follow(arm, ["link1", "link6"])
    assert not any(contact.searching for contact in said[-1])


def test_what_no_two_contacts_explain_are_three_at_least(arm):
    touches, said = follow(arm, ["link1", "link3", "link6"])
    (contact,) = said[-1]
    assert (contact.status, contact.at_least, contact.may_be_more) == ("not_separable", 3, True)
    assert contact.unknowns == 15 and contact.rank == 12
    assert contact.position is None and contact.candidates == ()
    np.testing.assert_allclose(contact.force, sum(touch.force for touch in touches), rtol=1e-3)


def test_at_least_is_not_known_where_nothing_says_it():
    assert least_contacts("not_separable", None) is None
    assert least_contacts("wrench_only", None) is None
    assert Contact("base", 0, "contact", "not_separable").may_be_more
