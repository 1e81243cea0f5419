# SPDX-License-Identifier: Apache-2.0
"""What touches, as `pushes` of the description has it."""

from dataclasses import replace

import numpy as np
import pytest
from shapes import box, chain, measured, still

from touchline.localizer.localizer import Localizer
from touchline.model.description import PushDescription
from touchline.model.robot import Robot
from touchline.native import core
from touchline.pipeline.pipeline import Pipeline

PLACE = np.array([0.03, -0.05, 0.1])
SLANTED = np.array([20.0, 0.0, -20.0])  # 45 degrees: softly beyond the cone of 0.8
Q = np.array([0.3, 0.9, -0.4])


def expecting(robot, **pushes):
    description = replace(robot.description, pushes=PushDescription(**pushes))
    return Robot(description, robot.mechanism)


def located(robot, q, loads):
    observer, estimate, skin = measured(robot, q, loads)
    return Localizer(observer, skin=skin).locate("base", q, estimate)


@pytest.mark.parametrize(("friction", "there"), [(0.8, True), (0.2, False)])
def test_a_push_beyond_the_cone_of_friction_is_not_looked_for(friction, there):
    robot = expecting(still(box(0.2, 0.2, 0.2)), friction=friction)
    answer = located(robot, [], [("body", PLACE, SLANTED)])
    places = [np.linalg.norm(c.position - PLACE) for c in answer.candidates]
    assert (answer.status == "located" and min(places) < 1e-3) == there


def test_a_link_that_is_not_to_be_touched_is_not_named():
    robot = chain()
    X = robot.T_world_links(Q)["link3"]
    point, push = X[:3, :3] @ [0.15, 0.0, 0.04] + X[:3, 3], X[:3, :3] @ [0.0, 0.0, -20.0]
    assert located(robot, Q, [("link3", point, push)]).link == "link3"
    only = expecting(robot, links=["link1", "link2"])
    answer = located(only, Q, [("link3", point, push)])
    assert {c.link for c in answer.candidates} <= {"link1", "link2"}


def test_a_narrow_gap_is_no_place_for_a_long_finger():
    """Two plates 10 mm apart: a push comes from outside unless what touches is a thin tool."""
    plates = (box(0.3, 0.3, 0.02, at=(0, 0, 0.02)), box(0.3, 0.3, 0.02, at=(0, 0, -0.01)))
    inner = {}
    for reach in (0.005, 0.1):
        robot = expecting(still(plates[0]), reach=reach)
        links = dict(robot.mechanism.links)
        links["body"] = replace(links["body"], **_shapes(links["body"], plates))
        robot = Robot(robot.description, replace(robot.mechanism, links=links))
        answer = located(robot, [], [("body", [0.05, 0.05, 0.01], [0.0, 0.0, 20.0])])
        inner[reach] = sum(c.probability for c in answer.candidates if abs(c.position[2]) < 0.011)
    assert inner[0.1] < inner[0.005]


def _shapes(link, shapes):
    (name,) = [key for key, value in vars(link).items() if isinstance(value, tuple) and value]
    return {name: shapes}


def test_an_exported_robot_keeps_what_touches(tmp_path):
    robot = expecting(chain(), friction=0.4, reach=0.05, links=["link2"])
    Pipeline(robot).export(tmp_path / "robot")
    read = core.read_robot(str(tmp_path / "robot"))
    assert (read.pushes.friction, read.pushes.reach) == (0.4, 0.05)
    assert [s.touchable for s in read.surfaces] == [False, False, True, False]


def test_a_pipeline_may_be_told_another_friction():
    assert Pipeline(chain(), friction=0.3)._native().pushes.friction == 0.3
    assert Pipeline(chain())._native().pushes.friction == 0.8
