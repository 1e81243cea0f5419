# SPDX-License-Identifier: Apache-2.0
"""What touches teach: one spot, and nothing of touches that are on several or too soft."""

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.model.description import TaughtTouch, WidgetDescription
from touchline.result.event import Event
from touchline.touch.spot import LEAST_STEP, POSTURE
from touchline.touch.teach import as_yaml, lesson_of_events, lesson_of_steps
from touchline.touch.touch import TorqueStep


def event(x=0.0, link="link4", status="located"):
    return Event(
        id=0,
        segment="base",
        level="contact",
        detected=1.5,
        cleared=2.0,
        status=status,
        link=link,
        position_link=np.array([x, 0.1, 0.0]),
        position_std=0.002,
    )


def step(*torques, q=(0.0, 0.0)):
    return TorqueStep(1.0, 1.5, np.array(q), np.array(torques))


def test_touches_at_one_place_are_a_button_that_holds_them():
    lesson = lesson_of_events([event(-0.004), event(0.004)], "toggle")
    assert (lesson.widget.kind, lesson.widget.link) == ("toggle", "link4")
    assert lesson.widget.at == (0.0, 0.1, 0.0) and lesson.touches == 2
    assert lesson.scatter == pytest.approx(0.004) and lesson.widget.radius == 0.02
    wide = lesson_of_events([event(-0.03), event(0.03)])
    assert wide.widget.radius == pytest.approx(0.09, abs=0.001)


@pytest.mark.parametrize(
    ("events", "words"),
    [
        ([], "holds no touch"),
        ([event(), event(status="ambiguous")], r"touches at 1\.50 s \(ambiguous\)"),
        ([event(), event(link="link5")], "different links, link4, link5"),
        ([event(-0.06), event(0.06)], "6 cm beside the others"),
    ],
)
def test_touches_that_are_no_spot_are_told(events, words):
    with pytest.raises(InputError, match=words):
        lesson_of_events(events)


def test_weak_steps_beside_strong_ones_are_not_meant():
    lesson = lesson_of_steps([step(2.0, 1.0), step(0.1, 0.0), step(2.0, np.nan), step(1.9, 1.0)])
    assert [touch.step for touch in lesson.widget.taught] == [(2.0, 1.0), (2.0, 0.0), (1.9, 1.0)]
    assert len(lesson_of_steps([step(2.0, 1.0)] * 4, touches=3).widget.taught) == 3


@pytest.mark.parametrize(
    ("steps", "words"),
    [([], "holds no touch"), ([step(0.5 * LEAST_STEP, 0.0)] * 3, "too soft")],
)
def test_steps_that_teach_nothing_are_told(steps, words):
    with pytest.raises(InputError, match=words):
        lesson_of_steps(steps)


def test_what_was_set_and_taught_elsewhere_stays():
    """Touches in the same posture are replaced, those in another are kept."""
    here, there = TaughtTouch((0.0, 0.0), (1.0, 0.0)), TaughtTouch((2 * POSTURE,) * 2, (1.0, 0.5))
    known = WidgetDescription("button", force=5.0, taught=[here, there])
    new = lesson_of_steps([step(2.0, 1.0)]).widget
    entry = as_yaml(new, known)
    assert entry["force"] == 5.0 and "most" not in entry
    assert [touch["q"] for touch in entry["taught"]] == [[2 * POSTURE] * 2, [0.0, 0.0]]
    placed = as_yaml(WidgetDescription("button", "link4", at=(0.0, 0.1, 0.0), radius=0.03))
    assert placed == {"kind": "button", "link": "link4", "at": [0.0, 0.1, 0.0], "radius": 0.03}
