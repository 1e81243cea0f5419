# SPDX-License-Identifier: Apache-2.0
"""Figures 5 and 6 and the applications: small versions of what the command runs."""

from functools import cache

import numpy as np
import pytest

from touchline.figure import new_figure
from touchline.model.robot import load_robot
from touchline.reproduce import (
    applications,
    applications_drawing,
    fig5,
    fig5_drawing,
    fig6,
    fig6_drawing,
    overlapping,
)
from touchline.reproduce.arm_view import ArmView
from touchline.reproduce.replay import Replay
from touchline.reproduce.wrench_routes import Routes
from touchline.simulation.random_push import PAUSE, joined


@pytest.fixture(scope="module")
def robot():
    return load_robot("sara-full")


@pytest.fixture(scope="module")
def pushes():
    return overlapping.pushed(0)


@pytest.fixture(scope="module")
def screw(robot):
    return applications.screw(robot, 0)


@pytest.fixture(scope="module")
def case(robot):
    """The cases of figure 6, each simulated once."""
    make = fig6.case
    return cache(lambda name: make(name, robot, 0))


def drawn(experiment, name):
    """The figure of an experiment all of whose checks hold."""
    assert [check.name for check in experiment.checks if not check.holds] == []
    assert list(experiment.drawings) == [name]
    return experiment.drawings[name].figure


def test_pushes_overlap_and_are_found_and_located(pushes):
    replay = pushes.noisy
    (start, end), (begin, finish) = (replay.spans(segment)[0] for segment in fig5.SEGMENTS)
    assert start < begin < end < finish
    assert replay.false_events() == []
    for delay in replay.delays():
        assert 0 <= delay.delay < 0.05
    for segment in fig5.SEGMENTS:
        errors = fig5.point_errors(replay, segment)
        assert np.isfinite(errors).sum() > 1000
        assert np.nanmedian(errors) < 0.01


def test_only_the_printed_form_leaves_a_ghost_in_recoil(pushes):
    first, second = fig5.recoils(pushes)
    assert first.force > 10.0 and first.speed > 0.5 and second.force == 0.0
    assert first.ghosts["paper"] > 0.1 > 0.02 > first.ghosts["segment"]


def test_a_ball_is_drawn_back_at_once_and_out_of_the_way():
    ball = overlapping.QuickRelease(
        "ball", "tool", (0, 0, 0), (0, 1, 0), start=1.0, hold=1.0, force=50.0, stiffness=1000.0
    )
    reach = ball.travel(ball.release)
    assert reach == pytest.approx(0.054) and ball.travel(0.5) == 0.0
    assert ball.travel(ball.release + reach / ball.retreat) == pytest.approx(0.0)
    assert ball.travel(ball.release + 10.0) == -overlapping.CLEAR


def test_the_tool_stays_right_while_somebody_leans_on_the_elbow(screw):
    part, table = screw, applications._rows(screw)
    force = applications._value(table, "screw", "wrist")
    moment = applications._value(table, "screw", "wrist", "moment_error_max")
    assert 0 < force < 0.5 and 0 < moment < 0.05
    assert applications._value(table, "screw", "wrist", by="eq5") > 5.0
    assert applications._value(table, "screw", "base", "point_error_median") < 0.01
    assert part.replay.false_events() == []


@pytest.mark.parametrize("name", ["link 0", "stretched arm", "three at once"])
def test_a_case_is_located_by_the_sensors_and_not_by_joint_torques_alone(case, name):
    verdicts = case(name).verdicts
    ours = [v for v in verdicts if v.method == "ours"]
    assert len(ours) == (3 if name == "three at once" else 1)
    assert all(v.right and v.found == v.link for v in ours)
    assert not any(v.right for v in verdicts if v.method == "eq5")


def test_figure_5_is_told_and_drawn(pushes, monkeypatch):
    monkeypatch.setattr(fig5, "pushed", lambda seed: pushes)
    ticks = []
    experiment = fig5.run(0, ticks.append, fig5_drawing.drawings)
    figure = drawn(experiment, "fig5")
    pictures, curves = (part.axes for part in figure.subfigs)
    assert len(pictures) == 6 and len(curves) == 6 and len(ticks) == fig5.STEPS
    assert len(curves[0].get_lines()) >= 4 and curves[0].get_ylabel() == "N"
    rows = experiment.tables["table"].rows
    assert [row["segment"] for row in rows] == list(fig5.SEGMENTS)
    assert all(row["false_detections"] == 0 and row["located"] > 0.9 for row in rows)
    series = experiment.series["series"]
    assert len({len(column) for column in series.values()}) == 1
    first, second = experiment.tables["recoil"].rows
    assert first["other_force_max"] > 10.0 and second["other_force_max"] == 0.0


def test_figure_6_is_told_and_drawn(case, monkeypatch):
    monkeypatch.setattr(fig6, "PUSHES", 1)
    monkeypatch.setattr(fig6, "case", lambda name, robot, seed: case(name))
    ticks = []
    experiment = fig6.run(0, ticks.append, fig6_drawing.drawings)
    figure = drawn(experiment, "fig6")
    above, below = (part.axes for part in figure.subfigs)
    assert [axes.get_title() for axes in above] == list(fig6.CASES)
    assert len(below[0].patches) == 3 * len(fig6.LINKS) and len(ticks) == fig6.STEPS
    rows = experiment.tables["table"].rows
    assert all(row["pushes"] == 1 for row in rows)
    assert fig6.total(rows, "ours") > fig6.total(rows, "eq5", fig6.LINKS[:6])


def test_the_applications_are_told_and_drawn(robot, screw, monkeypatch):
    def made(robot, seed):
        return screw

    made.__name__ = "screw"
    monkeypatch.setattr(applications, "screw", made)
    ticks = []
    experiment = applications.run(0, ticks.append, applications_drawing.drawings)
    figure = drawn(experiment, "applications")
    assert len(figure.axes) == 2 * 4 and ticks == ["screw", "teaching"]
    assert [axes.get_title(loc="left") for axes in figure.axes[::4]] == [
        "(a) Screwing",
        "(b) Teaching",
    ]
    assert len(figure.axes[1].get_lines()) == 3 and len(figure.axes[3].get_lines()) == 2
    assert {row["application"] for row in experiment.tables["table"].rows} == set(ticks)


def test_random_pushes_are_judged_by_link(robot, monkeypatch):
    monkeypatch.setattr(fig6, "PUSHES", 3)
    logs = [log for link in ("link0", "tool") for log in fig6.random_verdicts(robot, link, 0)]
    speeds = [np.abs(log.samples.qd).max() for log in logs]
    assert max(speeds) < 1.0  # the simulation is stable
    judged = fig6._judged(robot, logs)
    assert len(judged) == 6 * 3
    right = {(v.link, v.method): v.right for v in judged}
    assert right["link0", "ours"] and right["tool", "ours"] and not right["link0", "eq5"]


def test_the_classical_route_agrees_with_ours_at_rest(robot, monkeypatch):
    monkeypatch.setattr(fig6, "PUSHES", 2)
    replay = Replay(robot, joined(fig6.random_verdicts(robot, "link4", 1), PAUSE))
    routes, row = Routes(replay), 240
    forces = [routes.found(m, row, "base", "link4").force for m in ("classical", "ours")]
    np.testing.assert_allclose(*forces, atol=1.0)
    assert np.linalg.norm(forces[0]) > 15.0


def test_the_view_is_a_projection(robot):
    view = ArmView(robot, azimuth=0.0, elevation=0.0)  # seen along the x axis
    np.testing.assert_allclose(view.on_paper([3.0, 1.0, 2.0]), [1.0, 2.0], atol=1e-12)
    R = ArmView(robot, 0.7, 0.4).R_view_world
    np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-12)
    figure = new_figure(2, 2)
    axes = figure.subplots()
    view.draw(axes, np.zeros(7))
    assert len(axes.collections[0].get_paths()) > 500
