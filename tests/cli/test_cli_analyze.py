# SPDX-License-Identifier: Apache-2.0
"""`touchline analyze` on good recordings: the files it leaves and what it prints."""

import json
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.cli.bench import BENCHMARKS
from touchline.logs import write_table

TOUCH = slice(1000, 1200)  # samples


@pytest.fixture(scope="module")
def robot():
    return tl.load_robot("sara-full")


@pytest.fixture(scope="module")
def recording(robot):
    """Six seconds at 400 Hz; link 2 is pushed for half a second, then to the end."""
    samples = free_motion(robot, seconds=6.0, rate=400.0)
    samples = pushed(robot, samples, "link2", TOUCH, [20.0, 0.0, 0.0])
    return pushed(robot, samples, "link2", slice(2200, None), [0.0, -100.0, 0.0])


@pytest.fixture(scope="module")
def results(robot, recording, tmp_path_factory):
    folder = tmp_path_factory.mktemp("analysis")
    write_table(folder / "log.parquet", recording, robot.description)
    status = main(
        ["analyze", str(folder / "log.parquet"), "--robot", "sara-full", "--out", str(folder / "r")]
    )
    assert status == 0
    return folder / "r"


def strict_json(path):
    def refuse(word):
        raise ValueError(f"{word} is not JSON")

    return json.loads(path.read_text(), parse_constant=refuse)


def test_the_files_and_nothing_else(results):
    names = {path.name for path in results.iterdir()}
    tables = {"contacts.parquet", "estimates.parquet", "postures.parquet"}
    assert names == tables | {"analysis.json", "events.json", "report.html"}


def test_results_know_what_they_were_made_from(results, recording):
    origin = strict_json(results / "analysis.json")
    assert origin["log"] == str(results.parent / "log.parquet") and origin["robot"] == "sara-full"
    assert origin["samples"] == len(recording.time) and origin["method"] == "segment"


def test_postures_are_those_of_the_recording(results, recording):
    table = pq.read_table(results / "postures.parquet")
    time = table["time"].to_numpy()
    assert len(time) == 600 and np.diff(time).max() < 0.0126  # 400 Hz thinned to 100 Hz
    row = np.searchsorted(recording.time, time)
    np.testing.assert_array_equal(time, recording.time[row])
    np.testing.assert_array_equal(table["q.joint3"], recording.q[row, 2])


def test_estimates_are_those_of_the_observer(results, robot, recording):
    table = pq.read_table(results / "estimates.parquet")
    estimate = tl.Observer(robot).run(
        recording.time, recording.q, recording.qd, recording.tau, recording.wrench
    )
    names = table.column_names
    assert names[:2] == ["time", "health"]
    assert {"tau_ext.joint3", "wrist.ext.mz", "base.seg.fx"} <= set(names)
    np.testing.assert_array_equal(table["time"], recording.time)
    np.testing.assert_array_equal(table["health"], estimate.health)
    for j, name in enumerate(robot.joint_names):
        np.testing.assert_array_equal(table[f"tau_ext.{name}"], estimate.tau_ext[:, j])
    g = robot.segment_names.index("wrist")
    np.testing.assert_array_equal(table["wrist.seg.fy"], estimate.segment_wrench[:, g, 1])


def test_events_have_the_keys_of_the_contract(results):
    events = strict_json(results / "events.json")
    keys = {"id", "segment", "level", "detected", "cleared", "link", "body", "body_probability"}
    keys |= {"position", "position_link", "time_of_position", "position_std", "force"}
    keys |= {"force_peak", "status", "joint", "candidates"}
    assert all(keys <= set(event) for event in events)
    first, last = (e for e in events if e["segment"] == "base")
    assert 2.5 < first["detected"] < 2.52 and 3.0 < first["cleared"] < 3.3
    assert first["level"] == "collision" and last["cleared"] is None
    assert first["force"][0] == pytest.approx(20.0, abs=1.0)
    assert last["force"][1] == pytest.approx(-100.0, abs=5.0)


def test_contacts_have_a_row_per_sample_of_an_event(results):
    events = strict_json(results / "events.json")
    table = pq.read_table(results / "contacts.parquet").to_pydict()
    names = "time health event segment link body body_probability status x y z fx fy fz "
    names += "position_std pxx pxy pxz pyy pyz pzz"
    assert set(names.split()) <= set(table)
    for event in events:
        times = [t for t, e in zip(table["time"], table["event"], strict=True) if e == event["id"]]
        assert times[0] == pytest.approx(event["detected"])
        assert event["cleared"] is None or times[-1] < event["cleared"]
    assert set(table["status"]) <= {"located", "ambiguous", "not_separable", "wrench_only"}


def test_numbers_do_not_depend_on_the_size_of_the_parts(results, tmp_path, monkeypatch):
    monkeypatch.setattr("touchline.report.analysis.CHUNK", 333)
    log = results.parent / "log.parquet"
    assert main(["analyze", str(log), "--robot", "sara-full", "--out", str(tmp_path)]) == 0
    estimates = (pq.read_table(d / "estimates.parquet") for d in (tmp_path, results))
    assert next(estimates).equals(next(estimates))
    a, b = (pq.read_table(d / "contacts.parquet").to_pydict() for d in (tmp_path, results))
    for name in a:
        if name in ("segment", "link", "body", "status"):
            assert a[name] == b[name]
        else:  # a contact's place is refined from where the part before left it
            pairs = (np.array(column[name], dtype=float) for column in (a, b))
            np.testing.assert_allclose(*pairs, rtol=1e-6, atol=1e-9, err_msg=name)
    pieces, whole = strict_json(tmp_path / "events.json"), strict_json(results / "events.json")
    assert [e["detected"] for e in pieces] == [e["detected"] for e in whole]
    assert [e["cleared"] for e in pieces] == [e["cleared"] for e in whole]


def test_the_summary_tells_what_there_is(robot, recording, tmp_path, capsys):
    wrench = recording.wrench.copy()
    wrench[300:400, 1] = np.nan
    time = recording.time.copy()
    time[50] = time[49]
    odd = replace(recording, wrench=wrench, time=time)
    write_table(tmp_path / "log.csv", odd, robot.description)
    arguments = ["analyze", str(tmp_path / "log.csv"), "--robot", "sara-full"]
    options = ["--out", str(tmp_path / "r"), "--bandwidth", "500", "--method", "paper"]
    assert main([*arguments, *options]) == 0
    out = capsys.readouterr().out
    assert "detection: rows; not calibrated: thresholds follow from the noise figures" in out
    for word in ("400 Hz", "settling", "bad_time", "missing", "sensor_excluded", "joint7", "wrist"):
        assert word in out
    assert "K dt = 1.25 > 1" in out and "about 100 (--bandwidth 100" in out


def test_other_files_in_the_directory_stay(results, tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "report.html").write_text("old")
    log = results.parent / "log.parquet"
    assert main(["analyze", str(log), "--robot", "sara-full", "--out", str(tmp_path)]) == 0
    assert (tmp_path / "notes.txt").read_text() == "mine"
    assert (tmp_path / "report.html").read_text().startswith("<!doctype html>")


def test_help_has_an_example_in_every_command(capsys):
    assert main(["--help"]) == 0
    assert capsys.readouterr().out.count("Example: touchline ") >= 4
    for command in ("demo", "analyze", "check", "bench"):
        assert main([command, "--help"]) == 0
        assert f"Example: touchline {command}" in capsys.readouterr().out


def test_every_benchmark_explains_itself(capsys):
    assert main(["bench", "--help"]) == 0
    listed = capsys.readouterr().out
    for name in BENCHMARKS:
        assert f"\n  {name} " in listed
        assert main(["bench", name, "--help"]) == 0
        assert f"Example: touchline bench {name}" in capsys.readouterr().out


def test_events_are_numbered_in_the_order_of_detection(robot, tmp_path, monkeypatch):
    samples = free_motion(robot, seconds=8.0, rate=200.0)
    starts = (("link3", 300), ("tool", 500), ("link3", 700), ("handle", 900), ("tool", 1100))
    for link, start in starts:
        samples = pushed(robot, samples, link, slice(start, start + 100), [0.0, 12.0, 0.0])
    write_table(tmp_path / "log.parquet", samples, robot.description)
    arguments = ["analyze", str(tmp_path / "log.parquet"), "--robot", "sara-full", "--out"]
    found = []
    for chunk in (1 << 15, 411):
        monkeypatch.setattr("touchline.report.analysis.CHUNK", chunk)
        assert main([*arguments, str(tmp_path / "r")]) == 0
        found.append(strict_json(tmp_path / "r" / "events.json"))
    detected = [event["detected"] for event in found[0]]
    assert detected == sorted(detected) and len(detected) >= 5
    assert [e["id"] for e in found[0]] == list(range(len(detected)))
    names = [[(e["id"], e["segment"], e["cleared"]) for e in events] for events in found]
    assert names[0] == names[1]


def test_the_demo_finds_every_touch(tmp_path, capsys):
    out = str(tmp_path / "r")
    assert main(["demo", "--headless", "--duration", "6", "--out", out]) == 0
    printed = capsys.readouterr().out
    assert "4 of 4 contacts felt, 0 events without a contact" in printed
    assert printed.count("located") == 4
    assert (tmp_path / "r" / "report.html").is_file()
    assert main(["demo", "--headless", "--duration", "-1", "--out", out]) == 2


def test_a_simulated_log_that_cannot_be_written_is_told_before_the_work(tmp_path, capsys):
    (tmp_path / "file").touch()
    for out in (tmp_path / "file" / "log.parquet", tmp_path / "log.foo"):
        assert main(["simulate", "demo", "--out", str(out)]) == 2
        assert str(out) in capsys.readouterr().err
    assert main(["demo", "--headless", "--out", str(tmp_path / "file")]) == 2
    assert f"{tmp_path / 'file'}: cannot be used as a directory" in capsys.readouterr().err


@pytest.mark.parametrize(
    "option", ["--seconds=-1", "--seconds=nan", "--rate=0", "--rate=300", "--speed=-1"]
)
def test_impossible_numbers_of_a_simulation(option, tmp_path, capsys):
    out = str(tmp_path / "log.csv")
    assert main(["simulate", "free_motion", "--out", out, option]) == 2
    assert option.partition("=")[0] in capsys.readouterr().err


def test_what_is_wrong_with_a_recording_is_told_beside_the_results(
    recording, robot, tmp_path, capsys
):
    tau = recording.tau.copy()
    tau[:, 1] *= -1.0
    write_table(tmp_path / "log.parquet", replace(recording, tau=tau), robot.description)
    out = tmp_path / "r"
    assert (
        main(["analyze", str(tmp_path / "log.parquet"), "--robot", "sara-full", "--out", str(out)])
        == 0
    )
    (found,) = strict_json(out / "analysis.json")["findings"]
    assert "torque of joint2" in found and "opposite sign" in found
    assert f"note: check: {found}" in capsys.readouterr().out
    assert "opposite sign" in (out / "report.html").read_text()


def test_a_sound_recording_with_touches_has_no_findings(results):
    assert strict_json(results / "analysis.json")["findings"] == []
