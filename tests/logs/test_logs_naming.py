# SPDX-License-Identifier: Apache-2.0
"""The description's `log` key."""

import numpy as np
import pytest
from logs_support import describe

from touchline.errors import InputError
from touchline.logs import read_log
from touchline.logs.naming import Column, parse_naming
from touchline.model.description import SensorDescription


def names(log, signal="q", joints=("a", "b"), sensors=()):
    return [column.name for column in parse_naming(describe(joints, sensors, log)).joints[signal]]


def test_default_names_are_the_contract():
    naming = parse_naming(describe(["a"], ["base"]))
    assert naming.time == Column("time")
    assert {s: c[0].name for s, c in naming.joints.items()} == {
        "q": "q.a",
        "qd": "qd.a",
        "tau": "tau.a",
    }
    axes = ("fx", "fy", "fz", "mx", "my", "mz")
    assert naming.sensors["base"] == {axis: Column(f"base.{axis}") for axis in axes}


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        ("q{i}", ["q0", "q1"]),
        ("Position{i1}", ["Position1", "Position2"]),
        ("{joint}_pos", ["a_pos", "b_pos"]),
        (["x", "y"], ["x", "y"]),
        (["x", {"column": "y{i}"}], ["x", "y1"]),
        ({"b": "y"}, ["q.a", "y"]),
        ({"column": "q{i}", "factor": 2.0}, ["q0", "q1"]),
        (None, ["q.a", "q.b"]),
    ],
)
def test_joint_columns(value, expected):
    assert names({"q": value}) == expected


def test_joint_names_replace_the_placeholder():
    assert names({"joint_names": {"a": "arm_a"}}) == ["q.arm_a", "q.b"]


def test_factors():
    log = {
        "time": {"column": "t", "factor": 0.001},
        "tau": [{"column": "i1", "factor": 2.0}, {"column": "i2", "factor": -3}],
        "q": {"factor": 0.5},
        "sensors": {
            "base": {"fx": {"column": "F", "factor": 10.0}, "factor": -1.0},
            "wrist": {"column": "w_{axis}", "factor": 9.81},
        },
    }
    naming = parse_naming(describe(["a", "b"], ["base", "wrist"], log))
    assert naming.time == Column("t", 0.001)
    assert naming.joints["tau"] == (Column("i1", 2.0), Column("i2", -3.0))
    assert naming.joints["q"] == (Column("q.a", 0.5), Column("q.b", 0.5))
    assert naming.sensors["base"]["fx"] == Column("F", -10.0)
    assert naming.sensors["base"]["mz"] == Column("base.mz", -1.0)
    assert naming.sensors["wrist"]["mz"] == Column("w_mz", 9.81)


def test_a_list_has_a_column_for_each_axis():
    log = {"sensors": {"base": ["Fx", {"column": "Fy", "factor": 9.81}, "Fz", "Tx", "Ty", "Tz"]}}
    base = parse_naming(describe(["a"], ["base"], log)).sensors["base"]
    assert base["fx"] == Column("Fx") and base["fy"] == Column("Fy", 9.81)
    assert [base[axis].name for axis in ("mx", "my", "mz")] == ["Tx", "Ty", "Tz"]


def test_factors_are_applied(tmp_path):
    log = {"time": {"column": "ms", "factor": 0.001}, "tau": {"factor": -2.0}}
    log["sensors"] = {"hand": {"column": "{sensor}_{axis}", "factor": 10.0}}
    (tmp_path / "log.csv").write_text("ms,q.a,qd.a,tau.a,hand_fz\n1500,1,2,3,4\n")
    hand = SensorDescription("hand", "link", axes=("fz",))
    samples = read_log(tmp_path / "log.csv", describe(["a"], [hand], log))
    assert samples.time[0] == 1.5
    assert samples.tau[0, 0] == -6.0
    assert samples.wrench[0, 0, 2] == 40.0 and np.isnan(samples.wrench[0, 0, 0])


def test_topics():
    log = {"topics": {"joint_states": "/js", "wrench": {"base": "/ft"}}}
    naming = parse_naming(describe(["a"], ["base"], log))
    assert naming.joint_states == "/js" and naming.wrench_topics == {"base": "/ft"}


@pytest.mark.parametrize(
    ("log", "words"),
    [
        ({"taus": "x"}, "log: unknown key 'taus'; known: time, q, qd, tau, sensors"),
        ({"joint_names": {"aa": "x"}}, "log.joint_names: unknown key 'aa'; known: a, b"),
        ({"q": {"a": "x", "bb": "y"}}, "log.q: unknown key 'bb'; known: a, b"),
        ({"q": ["x"]}, "log.q: has 1 columns for 2 joints"),
        ({"q": "q{k}"}, "unknown placeholder {k} in 'q{k}'; allowed: {joint}, {i}, {i1}"),
        ({"q": "position"}, "column 'position' is used for q of a, q of b"),
        ({"q": "x{i}", "qd": "x{i}"}, "column 'x0' is used for q of a, qd of a"),
        ({"q": 5}, "log.q: must be a column's name or {column, factor}, not 5"),
        ({"time": {"column": 5}}, "log.time.column: must be a column's name, not 5"),
        ({"tau": {"factor": "two"}}, "log.tau.factor: must be a number other than 0, not 'two'"),
        ({"tau": {"factor": 0}}, "must be a number other than 0"),
        ({"sensors": {"bose": "x"}}, "log.sensors: unknown key 'bose'; known: base (did you"),
        ({"sensors": {"base": {"Fx": "x", "fy": "y"}}}, "log.sensors.base: unknown key 'Fx'"),
        ({"sensors": {"base": ["x"]}}, "log.sensors.base: has 1 columns for 6 axes"),
        ({"sensors": {"base": "ft"}}, "column 'ft' is used for fx of base, fy of base"),
        ({"topics": {"joints": "/x"}}, "log.topics: unknown key 'joints'"),
        ({"topics": {"wrench": {"base": 1}}}, "log.topics.wrench.base: must be a name, not 1"),
        ({"topics": "/x"}, "log.topics: must be a mapping, not '/x'"),
    ],
)
def test_mistakes_are_named(log, words):
    with pytest.raises(InputError) as caught:
        parse_naming(describe(["a", "b"], ["base"], log))
    assert words in str(caught.value)


def test_all_mistakes_at_once():
    log = {"x": 1, "q": ["a"], "sensors": {"y": "z"}}
    with pytest.raises(InputError) as caught:
        parse_naming(describe(["a", "b"], ["base"], log))
    assert len(caught.value.problems) == 3
