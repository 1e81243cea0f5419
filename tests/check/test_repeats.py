# SPDX-License-Identifier: Apache-2.0
"""Rows that were read twice are told, and neither rest nor coarse signals are taken for them."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.check.findings import Findings
from touchline.check.repeats import Repeats
from touchline.check.run import check
from touchline.logs import write_table
from touchline.observer.samples import Samples

SIGNALS = ("q", "qd", "tau", "wrench")
WRIST = 1


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def recording(robot):
    return free_motion(robot, rate=200.0)


def told(robot, samples, pieces=3):
    """What is noted of a recording that comes in pieces."""
    repeats, findings = Repeats(robot), Findings()
    for rows in np.array_split(np.arange(len(samples)), pieces):
        repeats.add(samples.where(rows))
    repeats.report(findings)
    assert findings.findings == []  # nothing that must be mended
    return [line for lines in findings.notes.values() for line in lines]


def read_twice(samples, rows):
    """The numbers of some rows are those of the row before; time goes on."""
    source = np.arange(len(samples))
    for row in rows:
        source[row] = source[row - 1]
    return replace(samples, **{name: getattr(samples, name)[source] for name in SIGNALS})


def drawn(samples, share):
    rng = np.random.default_rng(3)
    return np.flatnonzero(rng.random(len(samples)) < share)[1:]


def test_rows_that_were_read_twice_are_told_with_their_share(robot, recording, tmp_path):
    path = tmp_path / "log.parquet"
    rows = drawn(recording, 0.055)
    write_table(path, read_twice(recording, rows), robot.description)
    notes = check("sara-full", path).notes["time stamps"]
    (line,) = [line for line in notes if line.startswith("  rows ")]
    for name in ("positions", "velocities", "torques", *robot.sensor_names):
        share = float(line.partition(f"{name} in ")[2].partition(" %")[0])
        assert share == pytest.approx(100 * len(rows) / len(recording), abs=0.3)


@pytest.mark.parametrize("rate", [2, 5])
def test_a_sensor_slower_than_the_rows_is_told_alone(robot, recording, rate):
    """As it comes where the latest reading is written into each row."""
    wrench = recording.wrench.copy()
    slow = np.arange(len(recording)) // rate * rate
    wrench[:, WRIST] = wrench[slow, WRIST]
    (line,) = told(robot, replace(recording, wrench=wrench))
    assert "(wrist in " in line and "," not in line.partition("(")[2].partition(")")[0]


def coarse(samples, step):
    """As a recording with few digits."""
    steps = {"q": step, "qd": 5 * step, "tau": 50 * step, "wrench": 50 * step}
    return replace(samples, **{k: np.round(getattr(samples, k) / s) * s for k, s in steps.items()})


@pytest.mark.parametrize("step", [1e-4, 3e-4, 1e-3, 3e-3, 1e-2])
def test_coarse_signals_of_a_moving_arm_are_no_repeats(robot, recording, step):
    assert told(robot, coarse(recording, step)) == []


@pytest.mark.parametrize("step", [0.0, 1e-4, 1e-3, 1e-2])
def test_an_arm_that_rests_is_no_repeat(robot, step):
    """Noise of the readings, and positions that turn by half a step of theirs or stand."""
    rng, count = np.random.default_rng(1), 4000
    n, k = len(robot.joint_names), len(robot.sensor_names)
    time = np.arange(count) / 200.0
    q, qd = np.tile(rng.uniform(-1.0, 1.0, n), (count, 1)), np.zeros((count, n))
    tau = rng.normal(0.0, 0.05, (count, n))
    wrench = rng.normal(0.0, 0.05, (count, k, 6))
    samples = Samples(time, q, qd, tau, wrench)
    if step:
        noisy = replace(samples, q=q + rng.normal(0.0, 0.3 * step, q.shape))
        samples = coarse(noisy, step)
    assert told(robot, samples) == []


def test_a_clean_recording_is_no_repeat_nor_is_a_repeated_stamp(robot, recording):
    assert told(robot, recording) == []
    twice = np.sort(np.concatenate([np.arange(len(recording)), drawn(recording, 0.05)]))
    assert told(robot, recording.where(twice)) == []


def test_a_motion_that_stops_and_goes_is_no_repeat(robot, recording):
    """Without noise: all signals stand for a tenth of the time, for 0.1 s and longer."""
    source = np.arange(len(recording))
    for start in range(100, len(source) - 200, 400):
        source[start : start + 40] = start
    samples = {name: getattr(recording, name)[source] for name in SIGNALS}
    assert told(robot, replace(recording, **samples)) == []
