# SPDX-License-Identifier: Apache-2.0
"""Which event belongs to which true contact, where several begin together."""

import numpy as np

import touchline as tl
from touchline.logs.truth import TrueContact
from touchline.report.comparison import compare


def contact(link, force):
    time = np.array([2.0, 3.0])
    return TrueContact(link, time, np.zeros((2, 3)), np.tile(np.array(force, float), (2, 1)))


def event(number, segment, force=None, detected=2.1):
    given = None if force is None else np.array(force, float)
    return tl.Event(id=number, segment=segment, level="contact", detected=detected, force=given)


def test_no_contact_takes_the_event_of_another():
    """The event of joint torques alone has no force; it is that of the contact that is left."""
    truth = [contact("arm", [10, 0, 0]), contact("hand", [0, 20, 0])]
    events = [event(0, "wrist", [0, 19, 0]), event(1, "root")]
    rows = compare(events, truth)
    assert [(row.truth.link, row.event.id) for row in rows] == [("arm", 1), ("hand", 0)]


def test_an_event_belongs_to_one_contact_of_its_time():
    truth = [contact("arm", [10, 0, 0]), contact("hand", [0, 20, 0])]
    rows = compare([event(0, "wrist", [0, 19, 0]), event(1, "wrist", [10, 0, 0], 2.9)], truth)
    assert rows[0].event is None and rows[1].event.id == 0
    assert rows[1].force_error == 1.0
