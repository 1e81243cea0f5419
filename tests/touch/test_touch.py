# SPDX-License-Identifier: Apache-2.0
"""A simulated finger on a simulated Panda: pressed, slid, written, and called back."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.localizer.skin import Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot
from touchline.touch import Recognizer, Touch
from touchline.touch.teach import as_yaml, teach
from touchline.trials.finger import find_pad, project, rising, signals_of, sliding

TIME = np.arange(0.0, 2.2, 1e-3)


@pytest.fixture(scope="module")
def arm():
    robot = tl.load_robot("sara")
    return robot, Skin(robot)


def felt(robot, skin, widgets, fingers, q, seed=0):
    rng = np.random.default_rng(seed)
    robot = Robot(replace(robot.description, interface=widgets), robot.mechanism)
    s = signals_of(robot, q, fingers, TIME, 0.0, rng, rng)
    pipeline, touch = tl.Pipeline(robot, skin=skin), Touch(robot, skin)
    heard = []
    for name in widgets:
        touch.on(name, heard.append)
    for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
        touch.update(pipeline.update(*row))
    return touch, heard


def pad_of(skin, seed, width=0.07, height=0.04):
    rng = np.random.default_rng(seed)
    return find_pad(skin, ("link3", "link4", "link5"), width, height, rng)


def pressing(patch, given, u, begin, end, force=8.0):
    finger = sliding(
        patch, given, np.array([[u, 0.0], [u + 1e-6, 0.0]]), TIME, begin, end,
        np.full(len(TIME), force), 0.0,
    )  # fmt: skip
    assert finger is not None
    return finger


@pytest.mark.parametrize("seed", range(3))
def test_the_pressed_one_of_two_buttons_calls_back(arm, seed):
    robot, skin = arm
    q, patch, given = pad_of(skin, seed)
    places, _ = project(patch, given, np.array([[-0.025, 0.0], [0.025, 0.0]]))
    widgets = {
        name: WidgetDescription("button", patch.link, at=tuple(at), radius=0.02)
        for name, at in zip(("left", "right"), places, strict=True)
    }
    _, heard = felt(robot, skin, widgets, [pressing(patch, given, -0.025, 0.5, 0.9)], q)
    assert [(event.kind, event.widget) for event in heard] == [
        ("press", "left"), ("release", "left"), ("push", "left"),
    ]  # fmt: skip
    assert 0.5 < heard[0].time < 0.57


def test_a_slider_follows_the_finger_and_a_stroke_is_kept(arm):
    robot, skin = arm
    q, patch, given = pad_of(skin, 4)
    way = np.array([[-0.03, 0.0], [0.03, 0.0]])
    finger = sliding(patch, given, way, TIME, 0.4, 1.3, np.full(len(TIME), 8.0), 0.3)
    ends, _ = project(patch, given, way)
    slider = WidgetDescription("slider", patch.link, path=tuple(map(tuple, ends)), width=0.03)
    touch, heard = felt(robot, skin, {"speed": slider}, [finger], q)
    values = [event.value for event in heard if event.kind == "change"]
    assert values[0] < 0.3 and values[-1] > 0.85 and len(values) > 100
    page = replace(given, size=(0.09, 0.06))
    touch, heard = felt(robot, skin, {"page": page}, [finger], q)
    assert [event.kind for event in heard][-2:] == ["stroke", "swipe"] and len(touch.strokes) == 1
    stroke = touch.strokes[0].cleaned()
    assert 0.045 < np.ptp(stroke.points[:, 1]) < 0.065 and np.ptp(stroke.points[:, 2]) < 0.006


def test_a_blow_on_a_button_is_no_command(arm):
    robot, skin = arm
    q, patch, given = pad_of(skin, 5)
    finger = pressing(patch, given, 0.0, 0.5, 0.9)
    size = 200.0 * np.sin(np.pi * np.clip((TIME - 0.5) / 0.03, 0.0, 1.0))
    ratio = size / np.maximum(8.0 * rising(TIME, 0.5, 0.9), 1e-9)
    finger = replace(finger, force=np.where(size[:, None] > 0, finger.force * ratio[:, None], 0.0))
    button = WidgetDescription("button", patch.link, at=given.at, radius=0.03)
    touch, heard = felt(robot, skin, {"stop": button}, [finger], q)
    assert heard == [] and not touch.events


def test_a_button_is_taught_by_touching_it(arm):
    robot, skin = arm
    q, patch, given = pad_of(skin, 6)
    fingers = [pressing(patch, given, 0.0, begin, begin + 0.25) for begin in (0.3, 0.95, 1.6)]
    rng = np.random.default_rng(0)
    s = signals_of(robot, q, fingers, TIME, 0.0, rng, rng)
    lesson = teach(robot, s.time, s.q, s.qd, s.tau, s.wrench)
    assert lesson.touches == 3 and lesson.widget.link == patch.link
    true, _ = project(patch, given, np.zeros((1, 2)))
    assert np.linalg.norm(np.array(lesson.widget.at) - true[0]) < 2e-3
    assert as_yaml(lesson.widget)["radius"] == pytest.approx(0.02, abs=0.01)


def test_nothing_touched_teaches_nothing(arm):
    robot, skin = arm
    rng = np.random.default_rng(0)
    s = signals_of(robot, np.zeros(7), [], TIME, 0.0, rng, rng)
    with pytest.raises(tl.InputError, match="no touch"):
        teach(robot, s.time, s.q, s.qd, s.tau, s.wrench)


def test_unknown_names_are_told(arm):
    robot, skin = arm
    with pytest.raises(ValueError, match="double_tap"):
        Touch(robot, skin).on("dubble_tap", print)


def test_a_written_sign_is_read(arm):
    robot, skin = arm
    q, patch, given = pad_of(skin, 8, 0.05, 0.05)
    signs = {
        "L": [[-0.02, 0.02], [-0.02, -0.02], [0.02, -0.02]],
        "V": [[-0.02, 0.02], [0.0, -0.02], [0.02, 0.02]],
        "Z": [[-0.02, 0.02], [0.02, 0.02], [-0.02, -0.02], [0.02, -0.02]],
    }
    recognizer = Recognizer()
    recognizer.learn([np.array(way) for way in signs.values()], list(signs))
    for sign, way in signs.items():
        finger = sliding(patch, given, np.array(way), TIME, 0.3, 1.4, np.full(len(TIME), 6.0), 0.3)
        assert finger is not None
        touch, _ = felt(robot, skin, {"page": replace(given, size=(0.07, 0.07))}, [finger], q)
        assert recognizer.read(touch.strokes[-1].cleaned())[0][0] == sign


@pytest.fixture(scope="module")
def torques_alone():
    full = tl.load_robot("sara-full")
    robot = Robot(replace(full.description, sensors=()), full.mechanism)
    return robot, Skin(robot)


def test_a_spot_taught_by_torques_is_told_from_another_place(torques_alone):
    robot, skin = torques_alone
    q, patch, given = pad_of(skin, 6)
    other = find_pad(skin, ("link4", "link5"), 0.02, 0.02, np.random.default_rng(1), q)[1:]
    begins = (0.3, 0.95, 1.6)
    rng = np.random.default_rng(0)

    def signals(place):
        fingers = [pressing(*place, 0.0, begin, begin + 0.35) for begin in begins]
        return signals_of(robot, q, fingers, TIME, 0.0, rng, rng)

    s = signals((patch, given))
    lesson = teach(robot, s.time, s.q, s.qd, s.tau, s.wrench)
    assert lesson.touches == 3 and lesson.scatter < 0.02
    taught = Robot(replace(robot.description, interface={"go": lesson.widget}), robot.mechanism)
    for place, expected in (((patch, given), ["go"] * 3), (other, [])):
        s = signals(place)
        pipeline, touch = tl.Pipeline(taught, skin=skin), Touch(taught, skin)
        for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            touch.update(pipeline.update(*row))
        assert [e.widget for e in touch.events if e.kind == "press"] == expected
        assert len(touch.steps) == 3
