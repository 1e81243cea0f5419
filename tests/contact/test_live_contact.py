# SPDX-License-Identifier: Apache-2.0
"""Live contacts work themselves out when asked, and say the same whenever that is."""

import numpy as np
import pytest

import touchline as tl
from touchline.simulation.scenario import three_touches

KINDS = ("level", "decided", "clamped", "rate")


@pytest.fixture(scope="module")
def touched():
    robot = tl.load_robot("sara")
    return robot, three_touches(robot, speed=0.5, seconds=0.5).samples


def live(robot, s, look):
    """Contacts of each sample; `look(contact)` is called at once."""
    pipeline, contacts = tl.Pipeline(robot), []
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        contacts.append(pipeline.update(*sample).contacts)
        for contact in contacts[-1]:
            look(contact)
    return pipeline, contacts


def test_what_is_asked_later_is_what_would_have_been_said_at_once(touched):
    robot, s = touched
    said = []
    live(robot, s, lambda contact: said.append([getattr(contact, name) for name in KINDS]))
    _, contacts = live(robot, s, lambda contact: None)
    later = [[getattr(c, name) for name in KINDS] for sample in contacts for c in sample]
    assert later == said
    assert len(later) > 300


def test_live_contacts_are_those_of_the_recording(touched):
    robot, s = touched
    pipeline, contacts = live(robot, s, lambda contact: None)
    recorded = tl.Pipeline(robot)
    recorded.run(s.time, s.q, s.qd, s.tau, s.wrench)
    columns = recorded.contacts.columns()
    flat = [contact for sample in contacts for contact in sample]
    assert [c.segment for c in flat] == list(columns["segment"])
    assert [c.link for c in flat] == list(columns["link"])
    assert [c.event for c in flat] == list(columns["event"])
    placed = [c.position if c.position is not None else np.full(3, np.nan) for c in flat]
    np.testing.assert_array_equal(placed, np.stack([columns[x] for x in "xyz"], axis=1))
    assert [e.link for e in pipeline.events] == [e.link for e in recorded.events]


def test_a_live_contact_is_a_contact(touched):
    robot, s = touched
    _, contacts = live(robot, s, lambda contact: None)
    contact = next(c for sample in contacts for c in sample if c.status == "located")
    assert isinstance(contact, tl.Contact)
    copied = tl.Contact(
        **{name: getattr(contact, name) for name in tl.Contact.__dataclass_fields__}
    )
    assert copied.position_std == contact.position_std
    assert copied.size == contact.size and copied.likely_link == contact.likely_link
