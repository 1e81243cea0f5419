# SPDX-License-Identifier: Apache-2.0
"""Joints whose columns come in another order are named, by `check` and by `analyze`."""

import os
import re
from pathlib import Path

import numpy as np
import pytest
from pyarrow import parquet

import touchline as tl
from touchline.check.injected import PANDA, UR10, make_case
from touchline.check.order import log_keys
from touchline.check.run import check, write_fixes
from touchline.cli import main
from touchline.errors import InputError
from touchline.logs import write_table
from touchline.trials import real_recordings
from touchline.trials.recordings import record

TOLD = "{} of all joints seem to be in reversed order ("
CASES = {
    ("q", "qd", "tau"): TOLD.format("positions, velocities and torques"),
    ("q", "qd"): TOLD.format("positions and velocities"),
    (): None,
}
REPOSITORY = Path(__file__).resolve().parents[2]
NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")
PAN, ELBOW = 0, 2


@pytest.fixture(scope="module")
def healthy():
    robot = tl.load_robot("sara")
    return robot, record(robot, 3, pushed=False, seconds=4.0).samples


@pytest.fixture(scope="module")
def ur10(tmp_path_factory):
    file = tmp_path_factory.mktemp("order") / "robot.yaml"
    file.write_text(UR10 + "detection: {contact: {torque: 20.0}}\n")
    return file


def moved(samples, order, signals=("q", "qd", "tau")):
    """What belongs to joint j stands in the column of joint order[j]."""
    columns = np.argsort(order)
    for signal in signals:
        values = getattr(samples, signal)
        values[:] = values[:, columns]


@pytest.mark.parametrize("signals", CASES)
def test_reversed_joints_are_named(healthy, signals, tmp_path, capsys):
    robot, samples = healthy
    values = {k: getattr(samples, k).copy() for k in ("time", "q", "qd", "tau", "wrench")}
    changed = type(samples)(**values, row=0)
    moved(changed, range(7)[::-1], signals)
    log = tmp_path / "log.parquet"
    write_table(log, changed, robot.description)
    main(["check", "sara", str(log)])
    checked = capsys.readouterr()
    checked = " ".join((checked.out + checked.err).split())
    main(
        ["analyze", str(log), "--robot", "sara", "--out", str(tmp_path / "out"), "--report", "none"]
    )
    analyzed = capsys.readouterr()
    analyzed = " ".join((analyzed.out + analyzed.err).split())
    for told in (checked, analyzed):
        if signals:
            assert CASES[signals] in told
        else:
            assert "reversed order" not in told
    if signals:
        assert "log: {q: [q.joint7, q.joint6," in checked and "mend log" not in checked
        assert "mend log: q" in analyzed


@pytest.mark.parametrize("signals", ["all", "torque"])
@pytest.mark.parametrize(
    ("order", "words"),
    [
        ([2, 1, 0, 3, 4, 5], "of all joints seem to be in alphabetical order of the joints' names"),
        ([0, 2, 1, 3, 4, 5], "of elbow_joint and shoulder_lift_joint seem swapped"),
        ([2, 0, 1, 3, 4, 5], "seem to stand in another joint's column: "),
    ],
    ids=["alphabet", "swapped", "cycle"],
)
def test_any_order_is_named_and_mended(ur10, tmp_path, order, words, signals):
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    moved(case.samples, order, ("tau",) if signals == "torque" else ("q", "qd", "tau"))
    log, fixed = tmp_path / "log.parquet", tmp_path / "fixed.yaml"
    write_table(log, case.samples, case.robot.description)
    found = check(ur10, log)
    (line,) = found.findings
    what = "torques" if signals == "torque" else "positions, velocities and torques"
    assert line.startswith(f"{what} {words}"), line
    left, sure = re.search(r"\((\d+) % of .* by (\d+) standard errors", line).groups()
    assert int(left) < 10 and int(sure) >= 3
    names = [f"{name}_joint" for name in NAMES]
    keys = ("tau",) if signals == "torque" else ("q", "qd", "tau")
    expected = {key: [f"{key}.{names[column]}" for column in order] for key in keys}
    assert found.fixes == {"log": expected}
    assert f"tau: [tau.{names[order[0]]}, tau.{names[order[1]]}" in line
    write_fixes(ur10, found, fixed)
    assert check(fixed, log).findings == []


def test_a_rotated_order_is_called_so(tmp_path):
    robot, log = tmp_path / "robot.yaml", tmp_path / "log.parquet"
    robot.write_text(PANDA)
    case = make_case(tl.load_robot(robot), (), np.random.default_rng(5))
    moved(case.samples, [1, 2, 3, 4, 5, 6, 0])
    write_table(log, case.samples, case.robot.description)
    found = check(robot, log)
    assert any("in an order rotated by 6 (" in line for line in found.findings), found.findings
    assert found.fixes["log"]["q"][-1] == "q.panda_joint1"


def test_columns_and_factors_of_the_log_move_together(ur10, tmp_path):
    """The described columns have names and units of their own, and another key stays."""
    robot = tmp_path / "robot.yaml"
    columns = ", ".join(f"{{column: 'm{j}', factor: {1e-3 if j else 1.0}}}" for j in range(6))
    robot.write_text(f"{ur10.read_text()}log:\n  time: t\n  tau: [{columns}]\n")
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    case.samples.tau[:] = case.samples.tau[:, [ELBOW, 1, PAN, 3, 4, 5]]
    case.samples.tau[:, 1:] *= 1e3
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    renamed(
        tmp_path / "log.parquet",
        {"time": "t"} | {f"tau.{n}_joint": f"m{j}" for j, n in enumerate(NAMES)},
    )
    found = check(robot, tmp_path / "log.parquet")
    assert found.fixes["log"]["tau"][:3] == [
        {"column": "m2", "factor": 1e-3},
        {"column": "m1", "factor": 1e-3},
        "m0",
    ]
    write_fixes(robot, found, tmp_path / "fixed.yaml")
    assert check(tmp_path / "fixed.yaml", tmp_path / "log.parquet").findings == []


def renamed(path, names):
    table = parquet.read_table(path)
    parquet.write_table(table.rename_columns([names.get(x, x) for x in table.column_names]), path)


def test_columns_that_the_data_do_not_tell_are_not_named(ur10, tmp_path):
    """Two wrists that hardly move and bear nothing: which is which is said of neither."""
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    moved(case.samples, [0, 2, 3, 1, 5, 4])
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    (line,) = (found := check(ur10, tmp_path / "log.parquet")).findings
    untold = line.split("do not tell which columns are those of ")[1].split("): ")[0]
    assert {"wrist_2_joint", "wrist_3_joint"} <= set(untold.split(" and "))
    named = line.split("column: ")[1].split(" (")[0]
    assert "wrist_2" not in named and "wrist_3" not in named
    assert "shoulder_lift_joint in that of elbow_joint" in named
    assert found.fixes == {} and "record more motion, or try log: {q: [" in line


def test_an_arm_that_hardly_moves_tells_no_order(ur10, tmp_path):
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    for name in ("q", "qd", "tau"):
        values = getattr(case.samples, name)
        values[:] = values[:1] if name != "qd" else 0.0
    case.samples.tau[:] += 0.05 * case.rng.normal(size=case.samples.tau.shape)
    case.samples.q[:, 4:] = case.samples.q[:, 5:]
    moved(case.samples, [0, 1, 2, 3, 5, 4])
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    lines = check(ur10, tmp_path / "log.parquet").findings
    assert not any("swapped" in line or "column" in line for line in lines), lines


def test_an_order_hides_no_other_error(ur10, tmp_path):
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    case.samples.tau[:, 1] *= -1.0
    moved(case.samples, [2, 1, 0, 3, 4, 5])
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    found = check(ur10, tmp_path / "log.parquet")
    assert [("alphabetical" in x, "opposite sign" in x) for x in found.findings] == [
        (True, False),
        (False, True),
    ]
    assert found.fixes["joints"] == {"shoulder_lift_joint": {"gain": 1.0, "sign": -1}}
    write_fixes(ur10, found, tmp_path / "fixed.yaml")
    assert check(tmp_path / "fixed.yaml", tmp_path / "log.parquet").findings == []


def test_a_wrong_number_of_columns_keeps_its_message(ur10, tmp_path):
    robot = tmp_path / "robot.yaml"
    robot.write_text(f"{ur10.read_text()}log: {{tau: [a, b, c]}}\n")
    case = make_case(tl.load_robot(ur10), (), np.random.default_rng(5))
    write_table(tmp_path / "log.parquet", case.samples, case.robot.description)
    with pytest.raises(InputError, match="log.tau: has 3 columns for 6 joints"):
        check(robot, tmp_path / "log.parquet")


def test_what_a_bag_can_say_is_its_names(ur10):
    description = tl.load_robot(ur10).description
    own, order = np.arange(6), np.array([2, 1, 0, 3, 4, 5])
    names = log_keys(description, order, order, bag=True)["joint_names"]
    assert (
        names["elbow_joint"] == "shoulder_pan_joint" and names["wrist_1_joint"] == "wrist_1_joint"
    )
    assert log_keys(description, own, order, bag=True) == {}


def test_a_real_arm_whose_currents_nobody_has_described_is_told_its_alphabet(tmp_path):
    """A UR10, described by its model alone; its columns as a driver by the alphabet gives them."""
    data = Path(os.environ.get("TOUCHLINE_DATA", REPOSITORY.parent / "shared" / "data"))
    bag = data / "panda_ur10_rosbag2" / "ur10_exciting_trajectory.db3"
    if not bag.exists():
        pytest.skip(f"no recordings at {data}: set TOUCHLINE_DATA")
    (tmp_path / "robot.yaml").write_text(real_recordings.UR10)
    robot = tl.load_robot(tmp_path / "robot.yaml")
    samples = tl.read_log(bag, robot)
    right = tmp_path / "right.parquet"
    write_table(right, samples, robot.description)
    moved(samples, [2, 1, 0, 3, 4, 5])
    write_table(tmp_path / "log.parquet", samples, robot.description)
    found = check(tmp_path / "robot.yaml", tmp_path / "log.parquet")
    assert (
        "positions, velocities and torques of all joints seem to be in alpha" in found.findings[0]
    )
    assert found.findings[1:] == check(tmp_path / "robot.yaml", right).findings
    write_fixes(tmp_path / "robot.yaml", found, tmp_path / "fixed.yaml")
    again = check(tmp_path / "fixed.yaml", tmp_path / "log.parquet").findings
    assert not any("order" in line for line in again)


@pytest.mark.parametrize("joint", [1, 3])
def test_a_joint_that_is_turned_in_all_signals_is_named(healthy, joint, tmp_path, capsys):
    robot, samples = healthy
    values = {k: getattr(samples, k).copy() for k in ("time", "q", "qd", "tau", "wrench")}
    for signal in ("q", "qd", "tau"):
        values[signal][:, joint] *= -1.0
    log = tmp_path / "log.parquet"
    write_table(log, type(samples)(**values, row=0), robot.description)
    main(["check", "sara", str(log)])
    told = " ".join(capsys.readouterr().out.split())
    name = robot.joint_names[joint]
    assert f"position of {name} seems of opposite sign" in told
    if robot.description.joints[joint].measured:
        assert f"set the other sign ({name}: sign)" in told
