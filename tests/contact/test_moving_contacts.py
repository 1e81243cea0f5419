# SPDX-License-Identifier: Apache-2.0
"""A contact on a moving arm is placed where it is now, not where the filter remembers it."""

import numpy as np
import pytest

from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.pipeline.pipeline import Pipeline
from touchline.trials.arms import load_arm
from touchline.trials.moving import carried, moving_signals
from touchline.trials.touches import TouchSampler

ONSET, END = 0.52, 0.62  # s: after settling and a quiet time


@pytest.fixture(scope="module", params=["sara", "panda"])
def arm(request):
    try:
        robot = load_arm(request.param, 0)
    except InputError as error:
        pytest.skip(str(error))
    return robot, Skin(robot)


def touched(robot, skin, speed, swing, seed, segments=None):
    """One contact on each segment at once, on a moving arm without noise: all that is said."""
    rng = np.random.default_rng(seed)
    sampler = TouchSampler(skin, rng, segments=segments and segments[:1])
    touches = [sampler.sample(20.0)]
    for name in (segments or ())[1:]:
        touches.append(TouchSampler(skin, rng, segments=(name,)).sample(20.0, touches[0].q))
    timed = [(touch, ONSET) for touch in touches]
    signals = moving_signals(robot, timed, END, speed, rng, None, swing=swing, turning=True)
    pipeline = Pipeline(robot, skin=skin, torque_error=0.0, friction=0.5)
    pipeline.run(signals.time, signals.q, signals.qd, signals.tau, signals.wrench)
    table = pipeline.contacts
    answers = {}
    for answer, sample, segment in zip(table, table.sample, table.segment, strict=True):
        answers.setdefault((sample, robot.segment_names[segment]), []).append(answer)
    places = [carried(robot, touch, signals.q) for touch in touches]
    return touches, places, answers


def behind(points, forces, row):
    """How far a contact is seen beside its place without compensation: |v| / K across the force."""
    velocity = (points[row] - points[row - 1]) / 1e-3
    along = forces[row] / np.linalg.norm(forces[row])
    return np.linalg.norm(velocity - along * (velocity @ along)) / 100.0


@pytest.mark.parametrize("swing", [0.0, 1.0])
@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_a_contact_is_placed_where_it_is_now_at_any_speed(arm, speed, swing):
    robot, skin = arm
    lags = []
    for seed in range(6):
        (touch,), ((points, forces),), answers = touched(robot, skin, speed, swing, seed)
        row = len(points) - 1
        answer = {segment: a for (sample, segment), a in answers.items() if sample == row}
        (answer,) = answer[touch.patch.segment]
        nearest = min(answer.candidates, key=lambda c: np.linalg.norm(c.position - points[row]))
        assert answer.status in ("located", "ambiguous")
        assert nearest.body == touch.patch.body
        error = np.linalg.norm(nearest.position - points[row])
        lags.append(behind(points, forces, row))
        assert error < 0.2 * lags[-1] + 3e-4
    assert max(lags) > 2e-3 * speed  # there was something to compensate


def test_soon_after_the_onset_too(arm):
    """The force has been there for less than the filter's memory: it is younger than 1 / K."""
    robot, skin = arm
    for seed in range(4):
        (touch,), ((points, forces),), answers = touched(robot, skin, 2.0, 0.0, seed)
        for row in (540, 550, 570):
            (answer,) = answers[row, touch.patch.segment]
            nearest = min(np.linalg.norm(c.position - points[row]) for c in answer.candidates)
            assert nearest < 0.2 * behind(points, forces, row) + 3e-4


@pytest.mark.parametrize("speed", [1.0, 3.0])
def test_one_contact_on_each_segment_is_as_one(speed):
    robot = load_arm("sara", 0)
    skin = Skin(robot)
    names = robot.segment_names
    for seed in range(4):
        touches, places, answers = touched(robot, skin, speed, 0.0, 20 + seed, names)
        for touch, (points, forces) in zip(touches, places, strict=True):
            row = len(points) - 1
            (answer,) = answers[row, touch.patch.segment]
            nearest = min(np.linalg.norm(c.position - points[row]) for c in answer.candidates)
            assert nearest < 0.2 * behind(points, forces, row) + 3e-4
