# SPDX-License-Identifier: Apache-2.0
"""What a pipeline returns are values: compared, copied, pickled and told by what they say."""

import copy
import json
import pickle
from dataclasses import fields, replace
from xml.etree import ElementTree

import numpy as np
import pytest

import touchline as tl
from touchline.result.event import ADDED
from touchline.result.native import CONTACT, EVENT, LEVELS, STATUSES, ZONES
from touchline.simulation.scenario import three_touches


@pytest.fixture(scope="module")
def said():
    """Result of a sample, a contact, an event; and the same from another pipeline."""
    robot = tl.load_robot("sara")
    s = three_touches(robot, speed=0.5, seconds=0.4).samples
    found = []
    for _ in range(2):
        pipeline, results = tl.Pipeline(robot), []
        for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            results.append(pipeline.update(*sample))
        contacts = [contact for result in results for contact in result.contacts]
        contact = next(c for c in reversed(contacts) if c.status == "located")
        began = next(r for r in results if r.events)
        estimate = results[-1].estimate
        found.append((results[-1], contact, pipeline.events[0], estimate, began.events[0]))
    return found


KINDS = ["result", "contact", "event", "estimate", "change"]


@pytest.mark.parametrize("which", range(5), ids=KINDS)
def test_equal_values_are_equal_wherever_they_come_from(said, which):
    mine, other = said[0][which], said[1][which]
    assert mine is not other and mine == other
    assert mine != "something else" and not mine == None  # noqa: E711


@pytest.mark.parametrize("which", range(5), ids=KINDS)
@pytest.mark.parametrize(
    "copied", [copy.copy, copy.deepcopy, lambda x: pickle.loads(pickle.dumps(x))]
)
def test_copies_are_equal(said, which, copied):
    again = copied(said[0][which])
    assert type(again) is type(said[0][which])
    assert again == said[0][which]
    assert repr(again) == repr(said[0][which])


@pytest.mark.parametrize("which", [1, 2])
def test_one_field_may_be_replaced(said, which):
    value = said[0][which]
    moved = replace(value, position=np.ones(3))
    assert moved != value and moved == value.replace(position=np.ones(3))
    assert moved.segment == value.segment
    assert replace(moved, position=value.position) == value


def test_a_value_tells_what_it_says(said):
    contact, event = said[0][1:3]
    assert repr(contact).startswith("Contact(segment='")
    assert "level='contact'" in repr(contact) and "position=[" in repr(contact)
    assert "None" not in repr(contact)
    assert repr(event).startswith("Event(id=0, segment='")
    assert repr(said[0][0]).startswith("Result(time=") and "estimate=Estimate(" in repr(said[0][0])


def test_words_are_of_a_fixed_choice(said):
    contact, event = said[0][1:3]
    assert isinstance(contact.status, tl.Status) and isinstance(event.status, tl.Status)
    assert isinstance(contact.level, tl.ContactLevel)
    assert isinstance(contact.zone, tl.Zone)
    assert set(STATUSES) == set(tl.Status) and set(LEVELS) == set(tl.ContactLevel)
    assert set(ZONES) == {*tl.Zone, None}


def test_what_a_user_can_reach_is_in_the_package():
    for name in (*tl.__all__, *tl.LATER):
        assert getattr(tl, name).__name__.rpartition(".")[2] == name
        assert name in dir(tl)
    with pytest.raises(AttributeError, match="no attribute 'nothing'"):
        tl.nothing  # noqa: B018


def test_the_core_tells_every_field():
    told, derived = {field.name for field in CONTACT}, {"position_std"}
    assert {field.name for field in fields(tl.Contact)} == told - derived
    # Two disjoint lists, and each field of an event is on one of them.
    core = [field.name for field in EVENT]
    assert sorted(field.name for field in fields(tl.Event)) == sorted([*core, *ADDED])


def test_an_event_is_plain_json(said):
    event = said[0][2]
    assert json.loads(json.dumps(event.as_json()))["segment"] == event.segment


def test_events_that_begin_and_end_are_told_once():
    robot = tl.load_robot("sara")
    s = three_touches(robot, speed=0.0, seconds=0.6).samples
    pipeline, told = tl.Pipeline(robot), []
    for sample in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        told += pipeline.update(*sample).events
    for happened in (tl.Happened.BEGAN, tl.Happened.ENDED):
        ids = [change.event.id for change in told if change.happened == happened]
        assert len(ids) == len(set(ids))
    events = pipeline.events
    began = [change.event for change in told if change.happened == tl.Happened.BEGAN]
    assert [event.id for event in began] == [event.id for event in events]
    assert [event.detected for event in began] == [event.detected for event in events]
    ended = {c.event.id: c.event for c in told if c.happened == tl.Happened.ENDED}
    assert all(event == ended[event.id] for event in events if event.cleared is not None)
    decided = {c.event.id for c in told if c.event.decided is not None}
    assert decided == {event.id for event in events if event.decided is not None}


def test_a_notebook_shows_a_robot_and_its_pipeline_says_what_it_is():
    pipeline = tl.Pipeline("sara", bandwidth=50.0)
    assert repr(pipeline) == (
        "<Pipeline of sara: method segment, bandwidth 50 rad/s, 1000 Hz, 0 events>"
    )
    assert "described bandwidth" in repr(tl.Pipeline("sara"))
    (picture,) = ElementTree.fromstring(f"<div>{pipeline.robot._repr_html_()}</div>").findall("svg")
    x, y, width, height = map(float, picture.get("viewBox", "").split())
    places = [(float(c.get("cx", "")), float(c.get("cy", ""))) for c in picture.iter("circle")]
    assert len(places) == len(pipeline.robot.nodes)
    assert all(x < a < x + width and y < b < y + height for a, b in places)
    with pytest.raises(tl.InputError, match="no robot of this name"):
        tl.Pipeline("sarra")
