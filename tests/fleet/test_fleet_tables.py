# SPDX-License-Identifier: Apache-2.0
"""What a fleet has in common: tables and page tell what the results of each recording hold."""

import json
import re
from html import escape, unescape
from urllib.parse import unquote

import numpy as np
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest
from accessible import SCHEMES, WIDTHS, look, need_axe, serious
from free_motion import free_motion, pushed

import touchline as tl
from touchline.cli import main
from touchline.fleet.figures import EDGES, SETTLES, percentile
from touchline.fleet.manifest import Manifest
from touchline.fleet.page import write_page
from touchline.fleet.plan import make_plan
from touchline.logs import write_table

EPOCH = 1.7e9 - 1.7e9 % 3600  # s; the full hour before
DATE = "2023-11-14"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Three recordings: one undated; two with dates, of which one goes over a full hour."""
    folder = tmp_path_factory.mktemp("logs")
    robot = tl.load_robot("sara")
    for name, start in (("plain", 0.0), ("dated", EPOCH + 100.0), ("over & out", EPOCH + 3597.0)):
        samples = free_motion(robot, seconds=6.0, rate=200.0)
        samples = pushed(robot, samples, "handle", slice(800, 900), [30.0, 0.0, 0.0])
        samples.wrench[100:110, 0, 1] = np.nan
        samples.time[:] += start
        write_table(folder / f"{name}.parquet", samples, robot.description)
    (folder / "foreign.mcap").write_bytes(b"no recording" * 99)
    return folder


@pytest.fixture(scope="module")
def out(made, tmp_path_factory):
    folder = tmp_path_factory.mktemp("out")
    arguments = ["analyze", str(made), "--robot", "sara", "--out", str(folder), "--workers", "2"]
    assert main([*arguments, "--report", "summary"]) == 3
    return folder


def rows(out, name):
    return ds.dataset(out / "tables" / name, partitioning="hive").to_table().to_pylist()


def test_contacts_are_the_events(out):
    told = {(row["recording"], row["id"]): row for row in rows(out, "contacts")}
    events = {
        (path.parent.name, event["id"]): event
        for path in out.glob("*/events.json")
        for event in json.loads(path.read_text())
    }
    assert events and set(told) == set(events)
    for key, event in events.items():
        row = told[key]
        for name in ("segment", "link", "level", "status", "detected", "force_peak"):
            assert row[name] == event[name]
        assert row["robot"] == "sara"
        assert row["date"] == ("undated" if key[0] == "plain" else DATE)
    assert {row["hour"] for key, row in told.items() if key[0] == "over & out"} == {23}


def test_health_and_forces_are_those_of_the_samples(out):
    health = rows(out, "health")
    told = {(r["recording"], r["date"], r["hour"]): r["samples"] for r in health}
    assert told == {
        ("plain", "undated", 0): 1200,
        ("dated", DATE, 22): 1200,
        ("over & out", DATE, 22): 600,
        ("over & out", DATE, 23): 600,
    }
    for row in (r for r in health if r["recording"] == "plain"):
        table = pq.read_table(out / "plain" / "estimates.parquet")
        bits = table["health"].to_numpy()
        assert row["healthy"] == (bits == 0).sum() and row["MISSING"] == (bits & 8 != 0).sum() > 0
        time, quiet = table["time"].to_numpy(), bits == 0
        for event in json.loads((out / "plain" / "events.json").read_text()):
            quiet &= (time < event["detected"] - SETTLES) | (time > event["cleared"] + SETTLES)
        for joint in (r for r in rows(out, "joints") if r["recording"] == "plain"):
            values = table[f"tau_ext.{joint['joint']}"].to_numpy()
            assert joint["nan"] == np.isnan(values).sum()
            clean = values[quiet & np.isfinite(values)]
            assert joint["quiet"] == len(clean) > 100
            assert joint["torque_mean"] == pytest.approx(clean.mean(), rel=1e-9, abs=1e-12)
            assert joint["torque_largest"] == pytest.approx(np.abs(clean).max(), rel=1e-12)
        for row in (r for r in rows(out, "segments") if r["recording"] == "plain"):
            axes = [table[f"{row['segment']}.seg.{a}"].to_numpy() for a in ("fx", "fy", "fz")]
            sizes = np.linalg.norm(axes, axis=0)
            assert row["nan"] == np.isnan(sizes).sum()
            clean = sizes[quiet & np.isfinite(sizes)]
            if len(clean):
                expected = np.quantile(clean, [0.5, 0.95, 0.99], method="inverted_cdf")
                found = [row[f"force_{p}"] for p in ("p50", "p95", "p99")]
                assert np.all(found >= expected) and np.all(found <= expected * 1.05)


def test_percentiles_of_a_histogram():
    rng = np.random.default_rng(0)
    values = rng.lognormal(0.0, 1.0, 20000)
    counts = np.bincount(np.searchsorted(EDGES, values), minlength=len(EDGES) + 1)
    for share in (0.1, 0.5, 0.99):
        assert percentile(counts, share) == pytest.approx(np.quantile(values, share), rel=0.05)
    assert np.isnan(percentile(np.zeros(len(EDGES) + 1, int), 0.5))


def test_the_page_leads_to_each_recording(out):
    page = (out / "fleet.html").read_text()
    links = [unquote(unescape(link)) for link in re.findall(r'href="([^"]+)"', page)]
    assert sorted(links) == [f"{name}/report.html" for name in ("dated", "over & out", "plain")]
    assert all((out / link).is_file() for link in links)
    assert "foreign" in page and "over &amp; out" in page
    for heading in ("Robots", "Contacts by link", "Contacts by hour", "Calibration drift"):
        assert f"<h2>{heading}</h2>" in page
    assert "http" not in page.replace("http-equiv", "") and "<script" not in page


def test_the_page_names_touches_below_what_is_surely_felt(out, tmp_path):
    recordings = list(Manifest(out).rows.values())
    assert all(isinstance(row["faint"], list) for row in recordings)
    nothing = {"contacts": [], "health": [], "joints": [], "segments": []}
    told = [row | {"faint": [], "duration": 600.0} for row in recordings]
    write_page(tmp_path, told, {}, nothing)
    assert "Below what can be felt" not in (tmp_path / "fleet.html").read_text()
    told[1]["faint"] = ["event 3: 1.2 N & less"]
    write_page(tmp_path, told, {}, nothing)
    page = (tmp_path / "fleet.html").read_text()
    assert f"<li>{escape(told[1]['name'])}: event 3: 1.2 N &amp; less</li>" in page
    assert f"<b>{10 * len(told)} min</b>" in page


@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("width", WIDTHS)
def test_axe_finds_nothing_serious_on_the_page(browser, out, width, scheme):
    need_axe()
    look(browser, width, scheme)
    browser.open((out / "fleet.html").as_uri())
    assert serious(browser) == []


def test_tables_are_no_recordings(out):
    with pytest.raises(tl.InputError, match="no recordings there"):
        make_plan([str(out)], "sara")


def test_a_second_run_makes_the_same_tables(made, out):
    before = {name: rows(out, name) for name in ("contacts", "health", "joints", "segments")}
    page = (out / "fleet.html").read_text()
    (out / "dated" / "figures.json").unlink()
    assert main(["analyze", str(made), "--robot", "sara", "--out", str(out)]) == 3
    assert {name: rows(out, name) for name in before} == before
    assert (out / "fleet.html").read_text() == page
