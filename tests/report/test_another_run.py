# SPDX-License-Identifier: Apache-2.0
"""Logged signals, and results of another run or method, on the time line of a report."""

import json
import re
from dataclasses import replace

import numpy as np
import pyarrow.parquet as pq
import pytest
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.errors import InputError
from touchline.logs import open_log, write_table
from touchline.report.analysis import analyze
from touchline.report.beside import Beside


def data_of(page):
    script = re.search(r'<script type="application/json" id="data">(.*?)</script>', page, re.S)
    return json.loads(script.group(1))


@pytest.fixture(scope="module")
def pair(analysis):
    """The same recording with the other method, beside the first."""
    out = analysis.out.parent / "paper"
    other = analyze(analysis.log, "sara", out, method="paper", beside=analysis.out)
    return other, (out / "report.html").read_text()


def test_signals_are_those_of_the_log(analysis):
    with open_log(analysis.log, analysis.robot.description) as log:
        samples = next(log.chunks(1 << 13))
    traces = analysis.curves.traces
    shown = {panel.title: panel for panel in analysis.curves.on_page()}
    for title, values in (("positions", samples.q), ("velocities", samples.qd)):
        columns = [curve.column for curve in shown[f"{title}, as logged"].curves]
        np.testing.assert_array_equal(traces.high[: len(values), columns], values)
    names = analysis.robot.sensor_names
    for k, name in enumerate(names):
        curves = shown[f"{name}: force, as logged"].curves
        columns = [curve.column for curve in curves]
        np.testing.assert_array_equal(
            traces.low[: len(samples), columns], samples.wrench[:, k, : len(columns)]
        )
    assert names and "torques, as logged" in shown or np.isnan(samples.tau).all()


def test_other_results_lie_on_the_same_pieces_of_time(analysis, pair):
    other, _ = pair
    table = pq.read_table(analysis.out / "estimates.parquet")
    compared = [c for p in other.curves.on_page() for c in p.curves if c.beside]
    assert {c.result for c in compared} >= {"tau_ext.joint3", "base.seg.fx"}
    for curve in compared:
        values = other.curves.traces.high[: len(table), curve.column]
        np.testing.assert_array_equal(values, table[curve.result])
    assert other.curves.beside.shift == 0.0


def test_the_page_tells_whose_curves_and_events_they_are(analysis, pair):
    _, page = pair
    name = analysis.out.name
    assert f"are those of {name}." in page
    assert re.search(rf'<span class="key s3 axis-x beside">fx, {name}</span>', page)
    data = data_of(page)
    beside = [event for event in data["events"] if event.get("beside")]
    assert data["segments"][-1] == "beside" and len(beside) == len(analysis.events) == 1
    assert beside[0]["from"] == pytest.approx(analysis.events[0].detected - data["start"])


def test_runs_of_different_times_begin_together(analysis, tmp_path):
    robot = tl.load_robot("sara")
    samples = free_motion(robot, seconds=3.0, rate=200.0)
    samples = pushed(robot, samples, "link0", slice(400, 500), [20.0, 0.0, 0.0])
    samples = replace(samples, time=samples.time + 500.0)
    write_table(tmp_path / "late.parquet", samples, robot.description)
    late = analyze(tmp_path / "late.parquet", "sara", tmp_path / "late", beside=analysis.out)
    assert late.curves.beside.shift == pytest.approx(500.0, abs=1e-9)
    page = (tmp_path / "late" / "report.html").read_text()
    assert "is shifted by 500.000 s" in page
    data = data_of(page)
    assert data["count"] * data["width"] == pytest.approx(10.0, abs=0.1)  # of the longer run


def test_what_holds_no_results_is_refused(analysis, tmp_path, capsys):
    with pytest.raises(InputError, match=r"--beside .*holds no results"):
        Beside(tmp_path)
    words = ["analyze", str(analysis.log), "--robot", "sara", "--out", str(tmp_path / "r")]
    assert main([*words, "--beside", str(tmp_path / "none")]) != 0
    told = capsys.readouterr().err
    assert "--beside" in told and "Traceback" not in told and not (tmp_path / "r").exists()
