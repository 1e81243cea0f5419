# SPDX-License-Identifier: Apache-2.0
"""Joints whose columns come in the opposite order are named, by `check` and by `analyze`."""

import numpy as np
import pytest

import touchline as tl
from touchline.cli import main
from touchline.logs import write_table
from touchline.trials.recordings import record

TOLD = "{} of all joints seem to be in reversed order: mend log: {}"
CASES = {
    ("q", "qd", "tau"): TOLD.format("positions, velocities and torques", "q, qd and tau"),
    ("q", "qd"): TOLD.format("positions and velocities", "q and qd"),
    (): None,
}


@pytest.fixture(scope="module")
def healthy():
    robot = tl.load_robot("sara")
    return robot, record(robot, 3, pushed=False, seconds=4.0).samples


@pytest.mark.parametrize("signals", CASES)
def test_reversed_joints_are_named(healthy, signals, tmp_path, capsys):
    robot, samples = healthy
    values = {k: getattr(samples, k).copy() for k in ("time", "q", "qd", "tau", "wrench")}
    for signal in signals:
        values[signal] = np.ascontiguousarray(values[signal][:, ::-1])
    log = tmp_path / "log.parquet"
    write_table(log, type(samples)(**values, row=0), robot.description)
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
