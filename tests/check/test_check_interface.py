# SPDX-License-Identifier: Apache-2.0
"""Widgets that cannot work are told by `check`, with the smallest size that does."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.check.findings import Findings
from touchline.check.interface import check_interface
from touchline.localizer.skin import Skin
from touchline.model.description import WidgetDescription
from touchline.model.robot import Robot
from touchline.touch import Touch
from touchline.trials.finger import find_pad, middle_of, press, signals_of

ON, BESIDE = (-0.0, -0.04, 0.163), (0.0, -0.035, 0.153)  # on the surface of link4


def button(link="link4", at=ON, radius=0.03, **more):
    return WidgetDescription("button", link, at=at, radius=radius, **more)


def found(robot, **widgets):
    findings = Findings()
    robot = Robot(replace(robot.description, interface=widgets), robot.mechanism)
    check_interface(robot, findings)
    return findings


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def test_a_good_widget_is_no_finding(sara):
    findings = found(sara, start=button())
    assert findings.findings == [] and "start" in findings.text()


@pytest.mark.parametrize(
    ("widgets", "words"),
    [
        ({"a": button(), "b": button(at=BESIDE)}, "interface.a and interface.b overlap"),
        ({"a": button(), "b": WidgetDescription("toggle", "link4")}, "overlap on link4"),
        ({"a": button(at=(0.3, 0.0, 0.1), radius=0.3)}, "mm off the surface of 'link4'"),
        ({"a": button("base_mount", (0.13, 0.0, 0.01))}, "no sensor feels 'base_mount'"),
        ({"a": button(radius=0.002)}, "the smallest that works is 0.0"),
        ({"a": button(force=0.1)}, "0.1 N are not felt there"),
    ],
)
def test_what_cannot_work_is_told(sara, widgets, words):
    assert any(words in line for line in found(sara, **widgets).findings)


def test_joint_torques_alone_tell_no_place():
    full = tl.load_robot("sara-full")
    robot = Robot(replace(full.description, sensors=()), full.mechanism)
    (line,) = found(robot, a=button("link4", force=8.0)).findings
    assert "tell no place on 'link4'" in line and "touchline teach" in line


def test_the_size_that_is_said_to_work_does(sara):
    findings = found(sara, a=button(radius=0.001))
    (line,) = [line for line in findings.findings if "smallest" in line]
    radius = float(line.split("works is ")[1].split(" m")[0])
    assert 0.005 < radius < 0.03
    skin, time, pressed = Skin(sara), np.arange(0.0, 0.9, 1e-3), 0
    for seed in range(10):
        rng = np.random.default_rng(seed)
        q, patch, given = find_pad(skin, ("link3", "link4", "link5"), 0.02, 0.02, rng)
        at, normal = middle_of(patch, given)
        robot = Robot(
            replace(
                sara.description, interface={"a": button(patch.link, tuple(at), radius, force=2.5)}
            ),
            sara.mechanism,
        )
        finger = press(at, normal, patch.link, time, 0.4, 0.8, 3.0)
        s = signals_of(robot, q, [finger], time, 0.0, rng, rng)
        pipeline, touch = tl.Pipeline(robot, skin=skin), Touch(robot, skin)
        for row in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True):
            touch.update(pipeline.update(*row))
        pressed += [event.kind for event in touch.events][:1] == ["press"]
    assert pressed >= 9
