# SPDX-License-Identifier: Apache-2.0
"""The line of force action and the pitch test."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from shapes import chain, measured, sphere, still

from touchline.localizer.localizer import Localizer
from touchline.model.transforms import move_wrench, pose, rotation_rpy
from touchline.observer.observer import Observer
from touchline.result.line import line_at, line_point, pitch, pitch_score
from touchline.trials.touches import Touch, resting_signals

vectors = arrays(float, 3, elements=st.floats(-5, 5, width=32))


@given(vectors, vectors, st.floats(0.01, 100.0))
def test_the_line_goes_through_the_point_of_contact(point, direction, size):
    if np.linalg.norm(direction) < 0.1:
        return
    wrench = np.concatenate([direction, np.cross(point, direction)])
    unit = direction / np.linalg.norm(direction)
    np.testing.assert_allclose(line_at(wrench, point @ unit), point, atol=1e-6)
    np.testing.assert_allclose(line_point(size * wrench), line_point(wrench), atol=1e-6)
    assert abs(pitch(wrench)) < 1e-6


@given(vectors, vectors, vectors)
def test_the_pitch_score_is_the_same_about_any_origin_and_in_any_axes(rpy, shift, moment):
    wrench = np.concatenate([[3.0, -20.0, 5.0], moment])
    root = np.random.default_rng(0).normal(size=(6, 6))
    covariance = root @ root.T
    X = move_wrench(pose(rotation_rpy(rpy), shift))
    score = pitch_score(X @ wrench, X @ covariance @ X.T)
    assert score == pytest.approx(pitch_score(wrench, covariance), abs=1e-6)


def test_a_sphere_is_touched_where_geometry_says():
    robot = still(sphere(0.1))
    normal = np.array([2.0, -1.0, 2.0]) / 3
    observer, estimate, skin = measured(robot, [], [("body", 0.1 * normal, -20.0 * normal)])
    answer = Localizer(observer, skin=skin).locate("base", np.zeros(0), estimate)
    assert answer.status == "located"
    # The sphere is a polyhedron: its face lies a little below the point.
    assert np.linalg.norm(answer.position - 0.1 * normal) < 1.5e-3
    np.testing.assert_allclose(answer.force, -20.0 * normal, atol=1e-3)


def test_false_alarms_of_the_pitch_test_are_as_many_as_stated():
    """The score of noisy wrenches is a standard normal variable, at rest and after (18)."""
    robot = chain(sensors=(("base", "link0"), ("tip", "link3")))
    q = np.array([0.4, -0.7, 0.3])
    point, force = np.array([0.2, 0.04, 0.0]), np.array([2.0, -18.0, 4.0])
    rng = np.random.default_rng(5)
    observer, _, skin = measured(robot, q, [("link1", point, force)])
    localizer = Localizer(observer, skin=skin)
    patch = next(p for p in skin.patches if p.link == "link1")
    s = resting_signals(robot, q, [(Touch(q, patch, point, point, force), 0.0)], 60.0, rng)
    rows = Observer(robot).run(s.time, s.q, s.qd, s.tau, s.wrench).rows[200::40]
    wrenches = observer.estimate(rows).segment_wrench[:, 0]
    covariance = localizer.wrench_covariance("base", q, observer.estimate(rows[0]))
    scores = pitch_score(wrenches, covariance)
    assert len(scores) > 1400
    assert scores.std() == pytest.approx(1.0, abs=0.07)
    assert abs(scores.mean()) < 0.1
    # All six components, not only that one: their squares are those of six normal variables.
    rest = wrenches - wrenches.mean(axis=0)
    squares = np.einsum("ni,ij,nj->n", rest, np.linalg.inv(covariance), rest)
    assert squares.mean() == pytest.approx(6.0, abs=0.4)
