# SPDX-License-Identifier: Apache-2.0
"""The trial of `check` puts in what it says, and counts what was said."""

import re

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


@pytest.mark.parametrize(
    "names",
    [
        ("time in another unit", "gravity compensated"),
        ("positions in degrees", "a torque's sign"),
        ("torques in another unit", "hand missing in the model"),
        ("a position's sign", "sensor polarity"),
        ("base tilted", "a torque's sign"),
        ("hand missing in the model", "a torque's sign"),
        ("external torques logged", "a position's sign"),
        ("positions in degrees", "velocities in degrees"),
    ],
)
def test_one_error_does_not_hide_another(robot, names):
    case = make_case(robot, tuple(BY_NAME[name] for name in names), np.random.default_rng(5))
    findings = findings_of(case)
    tally = Tally()
    tally.add(case, findings)
    assert tally.named.total() == 2, findings


def test_a_delay_is_told_to_a_fifth_of_a_millisecond(robot):
    case = make_case(robot, (), np.random.default_rng(5))
    late = 3  # samples of 10 ms
    case.samples.tau[late:] = case.samples.tau[:-late].copy()
    (found,) = findings_of(case)
    told = re.search(r"come (\S+) \+- \S+ ms late", found)
    assert told is not None and abs(float(told[1]) - 30.0) < 0.2, found


def test_the_delay_of_each_sensor_is_told_by_itself(robot):
    case = make_case(robot, (), np.random.default_rng(5))
    late = {"wrist": 2, "handle": 4}  # samples of 10 ms
    for name, samples in late.items():
        wrench = case.samples.wrench[:, robot.sensor_names.index(name)]
        wrench[samples:] = wrench[:-samples].copy()
    pattern = re.compile(r"sensor (\S+) comes (\S+) \+- \S+ ms late")
    findings = findings_of(case)
    told = [found for line in findings for found in pattern.findall(line)]
    assert len(told) == len(findings) == len(late), findings
    for name, delay in told:
        assert abs(float(delay) - 10.0 * late[name]) < 0.5, findings


def test_unknown_friction_is_told_with_its_size(robot):
    case = make_case(robot, (), np.random.default_rng(5))
    qd = case.samples.qd[:, 1]
    case.samples.tau[:, 1] += 20.0 * np.tanh(qd / 0.02) + 10.0 * qd
    (found,) = findings_of(case)
    told = re.search(r"about (\S+) Nm and (\S+) Nm s/rad", found)
    assert told is not None and "torque of joint2 follows the sign" in found
    assert abs(float(told[1]) - 20.0) < 2.0 and abs(float(told[2]) - 10.0) < 3.0


def test_noise_is_measured_against_its_figures(robot):
    case = make_case(robot, (BY_NAME["noise figures too small"],), np.random.default_rng(6))
    assert [line for line in findings_of(case) if "noise: {tau:" in line]


def test_a_scaled_link_is_weighed(robot):
    case = make_case(robot, (BY_NAME["a link's inertia scaled"],), np.random.default_rng(5))
    links = robot.mechanism.links
    (name,) = (
        name
        for name, link in case.mechanism.links.items()
        if abs(link.inertia.mass - links[name].inertia.mass) > 0.1 * links[name].inertia.mass > 0
    )
    (found,) = findings_of(case)
    told = re.search(rf"inertia of {name} is .* weighs (\S+) kg", found)
    true = case.mechanism.links[name].inertia.mass
    assert told is not None and abs(float(told[1]) / true - 1) < 0.1, found
