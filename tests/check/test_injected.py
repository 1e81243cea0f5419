# SPDX-License-Identifier: Apache-2.0
"""The trial of `check` puts in what it says, and counts what was said."""

import numpy as np
import pytest

import touchline as tl
from touchline.check.injected import ERRORS, UR10, Case, Tally, findings_of, make_case, trial
from touchline.errors import InputError

BY_NAME = {error.name: error for error in ERRORS}


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


def test_every_error_changes_the_recording(robot):
    clean = make_case(robot, (), np.random.default_rng(3)).samples
    for error in ERRORS:
        case = make_case(robot, (error,), np.random.default_rng(3))
        same = all(
            np.array_equal(getattr(case.samples, name), getattr(clean, name), equal_nan=True)
            for name in ("time", "q", "qd", "tau", "wrench")
        )
        assert case.told and (not same or case.unmounted > 0), error.name


NAMED_ALONE = (
    "base tilted",
    "hand missing in the model",
    "hand modelled, not mounted",
    "sensor polarity",
    "a torque's sign",
    "samples missing",
    "a torque stuck later",
    "a torque clipped",
)


@pytest.mark.parametrize("name", NAMED_ALONE)
def test_an_error_is_named_and_nothing_else(robot, name):
    case = make_case(robot, (BY_NAME[name],), np.random.default_rng(5))
    findings = findings_of(case)
    tally = Tally()
    tally.add(case, findings)
    assert tally.named[name] == 1 and len(findings) == 1, findings


def test_a_clean_recording_is_silent(robot):
    assert findings_of(make_case(robot, (), np.random.default_rng(7))) == []


def test_a_coarse_signal_is_neither_stuck_nor_clipped(robot):
    case = make_case(robot, (), np.random.default_rng(7))
    case.samples.tau[:] = np.round(case.samples.tau)
    told = [line for line in findings_of(case) if "stuck" in line or "clipped" in line]
    assert told == []


def test_an_unmounted_hand_is_no_compensated_torque(tmp_path):
    """Beside a light wrist nearly all of the expected torque is the hand's weight."""
    path = tmp_path / "robot.yaml"
    path.write_text(UR10)
    try:
        arm = tl.load_robot(path)
    except InputError as error:
        pytest.skip(f"model of the UR10: {error}")
    case = make_case(arm, (BY_NAME["hand modelled, not mounted"],), np.random.default_rng(11))
    (found,) = findings_of(case)
    assert abs(float(found.split()[0]) - case.unmounted) < 0.1 and "kg too many" in found


def test_what_is_missed_or_false_is_counted(robot):
    empty = make_case(robot, (), np.random.default_rng(1))
    case = Case(robot, np.random.default_rng(0), empty.mechanism, empty.samples)
    tally = Tally()
    tally.add(case, ["time: 3 gaps, the longest 2 s"])
    case.told = {"a gap in time": "gaps"}
    tally.add(case, [])
    assert (tally.clean, tally.silent, tally.named.total()) == (1, 0, 0)
    assert "falsely: time (1)" in tally.text() and "nothing (1)" in tally.text()
    assert not tally.passed


def test_the_whole_trial_is_repeatable():
    try:
        first = trial(3, 4)
    except InputError as error:
        pytest.skip(f"models of the Panda and the UR10: {error}")
    assert first.text() == trial(3, 4).text()
    assert first.cases.total() >= 3 and first.clean == 1
