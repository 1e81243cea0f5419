# SPDX-License-Identifier: Apache-2.0
"""What is printed of an event: where, how hard, and how sure that is."""

import numpy as np
import pytest

from touchline.live.telling import began_line, ended_line, touch_line
from touchline.result.contact import Candidate
from touchline.result.event import Event
from touchline.touch.stroke import Stroke
from touchline.touch.touch import TouchEvent

PLACE = np.array([0.1, -0.2, 0.3])
WHOLE = Event(
    id=3,
    segment="base",
    level="contact",
    detected=12.5,
    cleared=13.25,
    status="located",
    link="link4",
    body="link4",
    body_probability=0.999,
    position=PLACE,
    force_peak=20.04,
)
STROKE = Stroke(None, "link5", np.array([[0.0, 0.0, 0.0], [0.2, 0.03, 0.04]]))
OTHER = (Candidate("link2", "link2", 0.6, PLACE), Candidate("link1", "link1", 0.4, PLACE))


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({}, "on link4, up to 20.0 N at (0.100, -0.200, 0.300) m"),
        ({"body_probability": 0.9}, "on link4 (90 %), up to 20.0 N at (0.100, -0.200, 0.300) m"),
        (
            {"status": "ambiguous", "body_probability": 0.62},
            "on link4 (ambiguous, 62 %), up to 20.0 N at (0.100, -0.200, 0.300) m",
        ),
        (
            {"status": "not_separable", "link": None, "position": None, "candidates": OTHER},
            "on segment base, perhaps on link2: several touches, or a twist (not separable), "
            "up to 20.0 N",
        ),
        (
            {"status": "wrench_only", "link": None, "joint": "elbow", "position": None},
            "on segment base: beyond elbow (wrench only), up to 20.0 N",
        ),
        (
            {"force_peak": None, "torque_peak": 1.234, "joint": "elbow", "status": "ambiguous"},
            "on link4 (ambiguous), up to 1.23 Nm on elbow",
        ),
    ],
)
def test_an_event_that_is_not_located_says_so(changes, told):
    event = WHOLE.replace(**changes)
    assert began_line(event, 10.0) == f"     2.500 s  contact 3 {told}"
    assert ended_line(event, 10.0) == f"     3.250 s  contact 3 over after 0.75 s: {told}"


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"kind": "press", "widget": "stop"}, "stop: press"),
        ({"kind": "change", "widget": "speed", "value": 0.25}, "speed: change: 0.25"),
        ({"kind": "toggle", "widget": "light", "value": True}, "light: toggle: True"),
        ({"kind": "tap", "link": "link5"}, "link5: tap"),
        ({"kind": "grab"}, "the arm: grab"),
        ({"kind": "swipe", "link": "link5", "value": STROKE}, "link5: swipe of 5.0 cm"),
    ],
)
def test_what_a_person_did_is_one_line(options, told):
    event = TouchEvent(**{"widget": None, "time": 12.5} | options)
    assert touch_line(event, 10.0) == f"     2.500 s  {told}"
