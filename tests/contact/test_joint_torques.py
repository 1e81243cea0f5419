# SPDX-License-Identifier: Apache-2.0
"""Joint torques alone: one contact on link k has min(k, 5) equations for five unknowns."""

import numpy as np
import pytest
from shapes import chain

from touchline.localizer.skin import Skin
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.touches import Touch, resting_signals

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5, 0.7])
# In the frame of the link: place and force of pushes on boxes 8 cm thick.
PUSHES = {
    "link3": ([0.12, 0.04, 0.01], [2.0, -18.0, 3.0]),
    "link5": ([0.13, 0.04, 0.01], [2.0, -18.0, 3.0]),
    "link6": ([0.10, -0.01, -0.04], [-1.0, 2.0, 15.0]),
    "link7": ([0.15, 0.02, 0.04], [3.0, 1.0, -12.0]),
}


@pytest.fixture(scope="module")
def arm():
    robot = chain((0.3,) * 7, sensors=())
    return robot, Skin(robot)


def felt(arm, links, step=0.1, seed=None):
    """What is said at the end of touches that begin one after the other, and the touches."""
    robot, skin = arm
    onsets = []
    for i, link in enumerate(links):
        patch = next(patch for patch in skin.patches if patch.link == link)
        T = robot.T_world_links(Q)[link]
        place, force = (np.array(values) for values in PUSHES[link])
        touch = Touch(Q, patch, T[:3, :3] @ place + T[:3, 3], np.zeros(3), T[:3, :3] @ force)
        onsets.append((touch, 0.06 + step * i))
    noise = None if seed is None else np.random.default_rng(seed)
    s = resting_signals(robot, Q, onsets, onsets[-1][1] + 0.12, noise)
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0)
    last = [
        pipeline.update(*sample).contacts
        for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True)
    ][-1]
    return pipeline, last, [touch for touch, _ in onsets]


@pytest.mark.parametrize("links", [("link5", "link7"), ("link7", "link6"), ("link6", "link5")])
def test_contacts_that_begin_one_after_the_other_are_found(arm, links):
    pipeline, contacts, touches = felt(arm, links)
    assert [event.link for event in pipeline.events] == list(links)
    for link, touch in zip(links, touches, strict=True):
        contact = next(c for c in contacts if c.link == link)
        assert contact.status == "located"
        # Five torques for five unknowns: none is left over that would speak against one more.
        none_over = (5, 5) if link == "link5" else (None, None)
        assert (contact.rank, contact.unknowns) == none_over
        assert contact.may_be_more == (link == "link5")
        np.testing.assert_allclose(contact.position, touch.position, atol=5e-3)
        np.testing.assert_allclose(contact.force, touch.force, atol=1.0)


def test_they_are_found_in_noise(arm):
    pipeline, _, touches = felt(arm, ("link7", "link5"), seed=1)
    for event, touch in zip(pipeline.events, touches, strict=True):
        assert (event.status, event.link) == ("located", touch.patch.link)
        assert np.linalg.norm(event.position - touch.position) < 0.02


def test_a_contact_with_too_few_equations_is_ambiguous_and_says_why(arm):
    pipeline, contacts, touches = felt(arm, ("link3", "link7"))
    assert {(c.link, c.status, c.rank, c.unknowns) for c in contacts} == {
        ("link3", "ambiguous", 3, 5),
        ("link7", "located", None, None),
    }
    distal = next(c for c in contacts if c.link == "link7")
    np.testing.assert_allclose(distal.position, touches[1].position, atol=5e-3)
    event = pipeline.events[0]
    assert (event.status, event.rank, event.unknowns) == ("ambiguous", 3, 5)
    assert event.as_json()["rank"] == 3


def test_contacts_at_the_same_instant_are_not_separable(arm):
    _, (contact,), touches = felt(arm, ("link6", "link7"), step=0.0)
    assert (contact.status, contact.rank, contact.unknowns) == ("not_separable", 7, 10)
    assert contact.position is None and contact.clamped is None
    for touch in touches:
        parts = [c for c in contact.candidates if c.link == touch.patch.link]
        assert any(np.linalg.norm(c.position - touch.position) <= c.radius for c in parts)
