# SPDX-License-Identifier: Apache-2.0
"""`calibrate` goes on from what `check --fix` wrote: every fix stays, and none is made twice."""

import re

import numpy as np
import pytest

import touchline as tl
from touchline.check.injected import ERRORS, PANDA, make_case
from touchline.cli.main import main
from touchline.identify.evidence import gather
from touchline.identify.leaning import find_lean, with_lean
from touchline.logs import write_table
from touchline.model.yaml_file import read_yaml

ANGLE = 0.05  # degrees, of gravity after calibration; links 1.5 % off leave `check` 0.3 degrees off


def case_of(folder, error, seed):
    """A simulated Panda with one error: its description, and what it records for 20 s."""
    path = folder / "robot.yaml"
    path.write_text(PANDA)
    errors = tuple(e for e in ERRORS if e.name == error)
    return path, make_case(tl.load_robot(path), errors, np.random.default_rng(seed))


def calibrated(folder, robot, log, capsys):
    """What calibration writes, and the sums over joints before and after [Nm]."""
    out = folder / f"{log.stem}_out.yaml"
    capsys.readouterr()
    assert main(["calibrate", str(log), "--robot", str(robot), "--out", str(out)]) == 0
    told = capsys.readouterr().out
    (sums,) = re.findall(r"sum over joints +([\d.]+) +([\d.]+) Nm", told)
    return out, tuple(map(float, sums)), told


def fixed(folder, robot, case, capsys):
    """The recording, the copy that check --fix writes, and as what it is calibrated."""
    log, copy = folder / "run.parquet", folder / "fixed.yaml"
    write_table(log, case.samples, case.robot.description)
    assert main(["check", str(robot), str(log), "--fix", str(copy)]) == 1
    out, sums, told = calibrated(folder, copy, log, capsys)
    assert main(["check", str(out), str(log)]) == 0, "a fix was lost, or made twice"
    return log, copy, out, sums, told


@pytest.mark.parametrize("error", ["a torque's sign", "torques in another unit"])
def test_what_check_mended_is_calibrated_as_if_it_had_been_right(error, tmp_path, capsys):
    robot, case = case_of(tmp_path, error, 3)
    _, copy, out, sums, _ = fixed(tmp_path, robot, case, capsys)
    _, right = case_of(tmp_path, "", 3)
    assert np.abs(case.samples.tau - right.samples.tau).max() > 1.0
    log = tmp_path / "right.parquet"
    factor = np.median(right.samples.tau / case.samples.tau, axis=0)
    write_table(log, right.samples, case.robot.description)
    assert calibrated(tmp_path, robot, log, capsys)[1] == pytest.approx(sums, rel=0.01)
    for before, after in zip(*(read_yaml(x)["joints"] for x in (copy, out)), strict=True):
        assert {key: after[key] for key in before} == before
    read = [j.gain * j.sign for j in tl.load_robot(out).description.joints]
    np.testing.assert_allclose(read, factor, rtol=0.01)


def test_a_missing_hand_that_check_added_stays_one_load(tmp_path, capsys):
    robot, case = case_of(tmp_path, "hand missing in the model", 12)
    _, copy, out, (before, after), _ = fixed(tmp_path, robot, case, capsys)
    assert after < 0.5 * before
    (hand,) = tl.load_robot(copy).description.loads
    first, *more = tl.load_robot(out).description.loads
    assert first == hand and sum(load.mass for load in more) < 0.1 * hand.mass


def degrees_between(one, other):
    cosine = np.dot(one, other) / np.linalg.norm(one) / np.linalg.norm(other)
    return np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0)))


def test_what_check_leaves_of_a_tilted_base_is_identified(tmp_path, capsys):
    robot, case = case_of(tmp_path, "base tilted", 11)
    _, copy, out, (_, after), told = fixed(tmp_path, robot, case, capsys)
    truth = case.mechanism.gravity
    assert degrees_between(tl.load_robot(copy).gravity, truth) > 5 * ANGLE
    assert degrees_between(tl.load_robot(out).gravity, truth) < ANGLE
    assert "the base leans by 0.3" in told and after < 0.2


def test_only_a_gravity_that_is_described_is_refined(tmp_path):
    path, case = case_of(tmp_path, "base tilted", 11)
    level = tl.load_robot(path)
    evidence = gather(level, [[case.samples]])
    assert find_lean(evidence) is None
    path.write_text(f"{PANDA}gravity: {case.mechanism.gravity.tolist()}\n")
    right = tl.load_robot(path)
    assert find_lean(gather(right, [[case.samples]])) is None
    path.write_text(f"{PANDA}gravity: {(case.mechanism.gravity + [0.08, 0.0, 0.0]).tolist()}\n")
    evidence = gather(tl.load_robot(path), [[case.samples]])
    lean = find_lean(evidence)
    assert degrees_between(with_lean(evidence.robot, lean).gravity, right.gravity) < ANGLE
