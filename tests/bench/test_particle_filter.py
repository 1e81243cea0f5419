# SPDX-License-Identifier: Apache-2.0
"""The baselines of the localization benchmark."""

import numpy as np
import pytest
from scipy.optimize import lsq_linear

import touchline as tl
from touchline.bench.localization.line_rules import first_entry, nearest_to_line
from touchline.bench.localization.particle_filter import (
    ParticleFilter,
    least_misfit,
    tempered_weights,
)
from touchline.bench.localization.trial import run_trial
from touchline.localizer.skin import Skin
from touchline.trials.cell import Cell
from touchline.trials.scene import arm_and_skin, make_scene


@pytest.mark.parametrize("columns", [4, 8, 12])
def test_the_quadratic_program_is_solved(columns):
    chance = np.random.default_rng(columns)
    C, y = chance.normal(size=(30, 13, columns)), chance.normal(size=13)
    x, cost = least_misfit(C, y)
    assert (x >= 0.0).all()
    for matrix, least in zip(C, cost, strict=True):
        best = 2.0 * lsq_linear(matrix, y, (0.0, np.inf), tol=1e-13).cost
        assert least == pytest.approx(best, rel=1e-6)


def test_tempered_weights_leave_enough_particles():
    cost = np.array([0.0, 5.0, 1000.0, 2000.0, 4000.0])
    for least in (1.0, 2.0, 4.0):
        weights = tempered_weights(cost, least)
        assert weights.sum() == pytest.approx(1.0)
        assert 1.0 / np.sum(weights**2) >= least - 1e-3
        assert (np.diff(weights) <= 0.0).all()
    alike = tempered_weights(np.array([0.0, 1.0]), 1.0)  # enough as they are: not tempered
    assert alike[1] / alike[0] == pytest.approx(np.exp(-0.5))


def test_particles_find_a_push_and_no_other():
    """The exact residual of one push, not filtered, as if it had lasted long."""
    robot, skin = arm_and_skin("sara-full", 1)
    found = 0
    for run in range(6):
        scene = make_scene(Cell("sara-full"), run)
        touch, s = scene.touches[0][0], scene.signals
        push = np.r_[s.tau[0] - s.tau[-1], (s.wrench[0] - s.wrench[-1]).ravel()]
        particles = ParticleFilter(skin, touch.q, np.random.default_rng(run))
        particles.update(0.0 * push)
        assert particles.places() == []
        for _ in range(20):
            particles.update(push)
        places = particles.places()
        found += len(places) == 1 and np.linalg.norm(places[0] - touch.position) < 0.01
    assert found >= 5


def test_the_line_rules_on_a_known_line():
    robot = tl.load_robot("sara")
    skin = Skin(robot)
    scene = make_scene(Cell("sara"), 1)
    touch = scene.touches[0][0]
    wrench = np.r_[touch.force, np.cross(touch.position, touch.force)]
    hits = skin.crossings(touch.q, touch.position - touch.force, touch.force, touch.patch.segment)
    first = min((c for c in hits if c.entry), key=lambda c: c.distance)
    for rule in (first_entry, nearest_to_line):
        place = rule(skin, touch.q, touch.patch.segment, wrench)
        np.testing.assert_allclose(place, first.position, atol=1e-6)
    beside = np.r_[
        touch.force, np.cross(touch.position + 5.0 * touch.normal[[1, 2, 0]], touch.force)
    ]
    assert first_entry(skin, touch.q, touch.patch.segment, beside) is None
    place = nearest_to_line(skin, touch.q, touch.patch.segment, beside)
    segment = [patch.link for patch in skin.patches if patch.segment == touch.patch.segment]
    assert min(skin.nearest(touch.q, link, place)[0] for link in segment) < 1e-9


def test_baselines_run_on_the_same_touches():
    trial = run_trial(Cell("sara", tier=1), 0, baselines=("first", "nearest", "particles"))
    assert [name for name, _ in trial.baselines] == ["first", "nearest", "particles"]
    assert all(len(errors) == 1 for _, errors in trial.baselines)
    moving = run_trial(Cell("sara", speed=1.0), 0, baselines=("first", "particles"))
    assert [name for name, _ in moving.baselines] == ["first"]
