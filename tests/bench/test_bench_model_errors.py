# SPDX-License-Identifier: Apache-2.0
"""Trials of the localization benchmark with models that are 2 % wrong."""

from dataclasses import replace

import numpy as np

from touchline.bench.localization.course import follow_course
from touchline.bench.localization.trial import run_trial
from touchline.detector.thresholds import make_thresholds
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.cell import Cell
from touchline.trials.scene import make_scene, told_and_real

OFF = Cell("sara", tier=1, speed=1.0, model_error=0.02)


def test_one_touch_of_a_wrong_model_in_motion_is_one():
    """Masses and inertias are 2 % off: the same touches, without what is known of that."""
    for run in (1, 30):
        trial = run_trial(OFF, run)
        assert trial.found
        assert trial.course.samples > 400
        assert trial.course.several == trial.course.wrong == 0
        robot, _, skin = told_and_real(OFF, run)
        thresholds = without_drift(make_thresholds(robot))
        blind = Pipeline(
            robot,
            skin=skin,
            wrench_error=0.0,
            torque_error=0.0,
            friction=0.5,
            thresholds=thresholds,
            tuning={"detector.drift_shown": 0.0, "detector.drift_grown": 0.0},
        )
        scene = make_scene(OFF, run)
        s = scene.signals
        blind.run(s.time, s.q, s.qd, s.tau, s.wrench)
        assert follow_course(blind, scene).several > 100


def without_drift(thresholds):
    rows = tuple(replace(row, drift=(0.0, 0.0, 0.0)) for row in thresholds.rows)
    return replace(thresholds, rows=rows)


def test_places_that_are_held_get_no_surer_than_the_model_allows():
    """Two contacts, 0.1 s apart, held for half a second beside each other."""
    for run in range(4):
        trial = run_trial(replace(OFF, contacts=2), run)
        assert trial.course.several == 0
        errors = np.array([touch.error for touch in trial.touches])
        assert np.median(errors) > 3e-4
        assert (errors < 4.0 * np.array([touch.std for touch in trial.touches])).all()
