# SPDX-License-Identifier: Apache-2.0
"""The wrench benchmark: every route is exact where it must be, tables say what was found."""

import csv
import importlib.util
from dataclasses import replace

import numpy as np
import pytest

from touchline.bench.wrench import methods as wrench_methods
from touchline.bench.wrench import run as wrench
from touchline.bench.wrench.log import Log
from touchline.bench.wrench.methods import METHODS, OPEN, between_samples, pseudo_inverse
from touchline.bench.wrench.scenarios import Scenario, Scene, scenarios
from touchline.bench.wrench.scores import (
    QUANTITIES,
    impact_values,
    leaders,
    run_scenario,
    window_errors,
)
from touchline.bench.wrench.stage import BIAS, IMPACT, QUIET, START, Stage
from touchline.bench.wrench.tables import row_keys, scenario_table, tally, verdict, write_tables
from touchline.cli import main
from touchline.errors import InputError
from touchline.localizer.skin import Skin
from touchline.model.robot import load_robot
from touchline.observer.dynamics import contact_loads
from touchline.observer.joint_momentum import tool_wrench
from touchline.observer.observer import Observer
from touchline.observer.samples import Samples
from touchline.trials.touches import Touch, TouchSampler, resting_signals

RESTING = np.array([0.4, 0.9, -0.5, -1.2, 0.6, 0.8, 0.3])
PEERS = [pytest.param(m, id=m.name) for m in METHODS]


@pytest.fixture(scope="module")
def robot():
    return load_robot("sara-full")


@pytest.fixture(scope="module")
def stage(robot):
    return Stage(robot, 0)


@pytest.fixture
def few(monkeypatch):
    monkeypatch.setattr(wrench_methods, "BANDWIDTHS", (100.0, 200.0))


def resting(robot, links, seconds=0.4):
    """A log of an arm at rest, pushed on some links from the second sample on, without noise."""
    skin, rng = Skin(robot), np.random.default_rng(1)
    sampler = TouchSampler(skin, rng)
    touches = []
    for link in links:
        patch = next(patch for patch in skin.patches if patch.link == link)
        point, normal = sampler._point(patch, RESTING)
        touches.append((Touch(RESTING, patch, point, normal, -20.0 * normal), 1e-3))
    s = resting_signals(robot, RESTING, touches, seconds, None)
    truth = np.zeros((len(s.time), len(robot.segment_names), 6))
    for touch, _ in touches:
        at = robot.segment_names.index(touch.patch.segment)
        truth[1:, at] += np.r_[touch.force, np.cross(touch.position, touch.force)]
    touched = {robot.body_of(link).segment: link for link in links}
    samples = Samples(s.time, s.q, s.qd, s.tau, s.wrench)
    return Log(robot, samples, np.zeros_like(s.q), truth, touched)


def needs(method):
    if method.missing:
        pytest.skip(method.missing)


@pytest.mark.parametrize("method", PEERS)
def test_every_route_is_exact_at_rest(robot, few, method):
    needs(method)
    links = ("tool",) if method.name == "joints" else ("link4", "tool", "handle")
    log = resting(robot, links)
    count = 0
    for trial in method.trials(log):
        known = np.isfinite(trial.wrench[-1])
        assert known.any(axis=1).sum() == (1 if method.name == "joints" else 3)
        np.testing.assert_allclose(trial.wrench[-1][known], log.truth[-1][known], atol=1e-8)
        count += 1
    assert count >= 2


def test_joint_torques_do_not_tell_a_push_near_the_base(robot, few):
    log = resting(robot, ("link1",))
    for trial in wrench_methods.joints(log):
        assert np.linalg.norm((trial.wrench - log.truth)[-1, 0, :3]) > 1.0


def test_one_touched_link_is_the_tool_wrench(robot, few):
    log = resting(robot, ("link6",))
    q, residual = log.samples.q, np.random.default_rng(0).normal(size=log.samples.q.shape)
    found = pseudo_inverse(log, residual, ("link6",))[:, 0]
    expected = tool_wrench(robot, q, residual, "link6").wrench
    origin = robot.T_world_links(q[0])["link6"][:3, 3]
    np.testing.assert_allclose(found[:, :3], expected[:, :3], atol=1e-9)
    moment = expected[:, 3:] + np.cross(origin, expected[:, :3])
    np.testing.assert_allclose(found[:, 3:], moment, atol=1e-9)


def test_several_touched_links_are_solved_together(robot, few):
    """Three wrenches need 18 equations, and there are seven: the torques are right all the same."""
    log = resting(robot, ("link4", "tool", "handle"))
    trial = next(wrench_methods.joints(log))
    assert np.isfinite(trial.wrench).all()
    residual = Observer(robot, trial.bandwidth).run(*log.signals()).tau_ext[-1]
    loads = np.zeros(7)
    for s, segment in enumerate(robot.segment_names):
        link = log.touched[segment]
        loads += contact_loads(robot, RESTING, link, trial.wrench[-1, s]).torque
    np.testing.assert_allclose(loads, residual, atol=1e-8)
    assert np.linalg.norm(trial.wrench[-1] - log.truth[-1]) > 1.0


def test_the_named_contact_link_does_not_change_what_idyntree_finds(robot):
    pytest.importorskip("idyntree", reason="idyntree is not installed: pip install idyntree")
    log = resting(robot, ("link5",), 0.02)
    signals = (log.samples.q, log.samples.qd, log.acceleration, log.samples.wrench)
    named = wrench_methods.run_idyntree(log, *signals)
    unnamed = wrench_methods.run_idyntree(replace(log, touched={}), *signals)
    np.testing.assert_allclose(named, unnamed, atol=1e-9)
    with pytest.raises(InputError, match="link tool is on part wrist, not on base"):
        wrench_methods.run_idyntree(replace(log, touched={"base": "tool"}), *signals)


def test_exact_accelerations_leave_the_push_alone(stage, few):
    """The accelerations are MuJoCo's: what iDynTree makes of them is the truth at once."""
    pytest.importorskip("idyntree", reason="idyntree is not installed: pip install idyntree")
    log = stage.three.log(None, stage.rng(0))
    method = next(m for m in METHODS if m.name == "idyn-exact")
    raw = next(t for t in method.trials(log) if t.bandwidth == OPEN)
    errors = window_errors(log, raw.wrench, (0.0, np.inf))
    assert errors[..., 0].max() < 0.02 and errors[..., 1].max() < 0.01
    assert np.linalg.norm(log.truth[..., :3], axis=-1).max(axis=0).min() > 19.9


def test_signals_between_samples_belong_to_one_instant(stage):
    log = stage.set_off(20.0)
    q, qd, qdd, wrench = between_samples(log)
    assert len(q) == len(qd) == len(qdd) == len(wrench) == len(log.time)
    sure = log.time > 0.91
    exact = (log.acceleration[1:] + log.acceleration[:-1])[sure[1:]] / 2
    error = qdd[1:][sure[1:]] - exact
    assert np.abs(error).max() < 6 * np.sqrt(2) * 2e-4 / 1e-3  # the noise of the velocities alone


def test_our_numbers_are_those_of_the_observer(robot, stage, few):
    log = stage.free(8.0)
    scenario = Scenario("free", "", lambda: [Scene("", log)], touched=False)
    outcome = run_scenario(scenario, METHODS[:2], lambda name: None)
    rows = log.time >= START
    for method in ("segment", "paper"):
        for score in (s for s in outcome.scores if s.method == method and s.bandwidth < OPEN):
            direct = Observer(robot, score.bandwidth, method).run(*log.signals()).segment_wrench
            force = np.linalg.norm(direct[rows, 0, :3], axis=1)
            rms = score.values["", "base", "force_rms"]
            assert rms == pytest.approx(np.sqrt(np.mean(force**2)), rel=1e-12)
            high = score.values["", "base", "force_p999"]
            assert high == pytest.approx(np.quantile(force, 0.999), rel=1e-12)
    assert outcome.best("segment").bandwidth == 100.0
    assert outcome.shipped() is outcome.best("segment")


def test_errors_are_about_the_sensor(robot):
    log = resting(robot, ("tool",), 0.02)
    force, moment = np.array([1.0, 2.0, 2.0]), np.array([0.3, 0.0, 0.4])
    wrist = robot.segment_names.index("wrist")
    off = np.r_[force, moment + np.cross(log.origins[0, wrist], force)]
    wrong = log.truth.copy()
    wrong[:, wrist] += off
    errors = window_errors(log, wrong, (0.005, 0.015))
    assert errors.shape == (10, 3, 2)
    np.testing.assert_allclose(errors[:, wrist], [[3.0, 0.5]] * 10, atol=1e-12)
    assert np.abs(np.delete(errors, wrist, axis=1)).max() == 0.0


def test_an_impact_is_judged_by_peak_delay_and_threshold(robot):
    log = resting(robot, ("tool",), QUIET + 0.5)
    truth = np.zeros_like(log.truth)
    onset = QUIET + 0.1
    age = log.time - onset
    truth[:, 1, 0] = np.where((age >= 0) & (age <= 0.02), IMPACT * np.sin(np.pi * age / 0.02), 0.0)
    log = replace(log, truth=truth)
    late = np.roll(0.8 * truth, 3, axis=0)
    late[log.time < QUIET, 1, 2] = 4.0  # a threshold of 6 N
    values = impact_values(Scene("", log, [("wrist", onset)]), late)
    assert values["", "wrist", "peak_error"] == pytest.approx(20.0, abs=1e-6)
    assert values["", "wrist", "peak_delay"] == pytest.approx(3.0)
    first = 3.0 + 1e3 * 0.02 / np.pi * np.arcsin(6.0 / (0.8 * IMPACT))
    assert first <= values["", "wrist", "detection"] <= first + 1.0
    late[log.time < QUIET, 1, 2] = 40.0  # above all that follows
    missed = impact_values(Scene("", log, [("wrist", onset)]), late)
    assert np.isnan(missed["", "wrist", "detection"])


def test_logs_are_what_they_say(robot, stage):
    jitter = np.diff(stage.three_pushes(stage.jittered()).time)
    assert jitter.min() == pytest.approx(5e-4) and jitter.max() == pytest.approx(1.5e-3)
    limits = [joint.range for joint in robot.description.joints]
    hard = stage.free(30.0, None)
    assert (np.abs(hard.samples.tau).max(axis=0) < limits).all()  # none is cut off
    assert 20.0 < np.abs(hard.acceleration).max() < 31.0 and not hard.truth.any()
    biased, plain = stage.biased().samples.wrench, stage.free(8.0).samples.wrench
    shift = (biased[:2000] - plain[:2000]).mean(axis=0)
    np.testing.assert_allclose(shift[1], BIAS, atol=0.02)
    np.testing.assert_allclose(shift[[0, 2]], 0.0, atol=0.02)
    again = Stage(robot, 0).three_pushes()
    np.testing.assert_array_equal(again.samples.wrench, stage.three_pushes().samples.wrench)
    other = Stage(robot, 1).push("link3")
    assert not np.array_equal(other.samples.q, stage.push("link3").samples.q)


def test_the_best_and_ties():
    row = {"segment": 1.05, "classical": 1.0, "idyn-out": 1.2, "idyn-exact": 0.1, "joints": np.nan}
    assert leaders(row)[0] == "idyn-exact"
    assert leaders({"a": 1.0, "b": 1.09, "c": 1.11, "d": np.nan}) == ["a", "b"]
    assert leaders({"a": np.nan}) == []
    assert verdict(row) == "tie" and verdict(row, "idyn-out") == "win"
    assert verdict(row, "idyn-exact") == "loss" and verdict(row, "joints") == ""
    assert verdict({"segment": 2.0, "classical": 1.0}) == "loss"


def test_tables_hold_every_method_and_quantity(stage, few, tmp_path):
    methods = [m for m in METHODS if not m.missing]
    sweep = Scenario("push", "", lambda: [Scene(x, stage.push(x)) for x in ("link3", "tool")])
    outcome = run_scenario(sweep, methods, lambda name: None)
    keys = row_keys(outcome)
    assert len(keys) == 3 * 3 * len(QUANTITIES)
    lines = scenario_table(outcome, methods).splitlines()
    assert len(lines) == 3 + 3 * len(QUANTITIES)  # title, head, bandwidths
    assert all(method.name in lines[1] for method in methods)
    text = wrench.link_table(outcome, methods)
    assert "link3" in text and "tool" in text
    write_tables(tmp_path, [outcome], methods)
    with (tmp_path / "wrench.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == len(keys)
    assert {row["verdict"] for row in rows} <= {"win", "tie", "loss"}
    assert [(row["scene"], row["part"], row["quantity"]) for row in rows] == keys
    assert float(rows[0]["segment"]) == pytest.approx(
        outcome.best("segment").values[keys[0]], rel=1e-5
    )
    counts = tally([outcome], methods).splitlines()
    assert len(counts) == 1 + len(methods) + 2
    for line in counts[1 : 1 + len(methods)]:
        assert sum(int(x) for x in line.split()[-3:]) <= 3 * len(QUANTITIES)


def test_a_missing_peer_is_one_line_that_says_how_to_install_it(few, monkeypatch):
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    result = wrench.run_benchmark(0, ["set off, 20 rad/s2"])
    assert [m.name for m in result.methods] == ["segment", "paper", "classical", "joints"]
    assert list(result.notes) == [
        "pinocchio is not installed: pip install pin",
        "idyntree is not installed: pip install idyntree",
    ]
    assert result.notes[1] in str(result)


def test_bad_input_is_refused_before_anything_runs(stage, tmp_path, capsys):
    with pytest.raises(InputError, match=r"unknown scenario 'nap'; there are: free, 2 rad/s2; "):
        wrench.run_benchmark(0, ["nap"])
    file = tmp_path / "file"
    file.write_text("")
    assert main(["bench", "wrench", "--out", str(file)]) == 2
    assert "cannot be used as a directory" in capsys.readouterr().err
    names = [scenario.name for scenario in scenarios(stage)]
    assert len(names) == len(set(names)) == 23


def test_figures_show_every_scenario(stage, few, tmp_path):
    pytest.importorskip("matplotlib")
    from touchline.bench.wrench.figure import errors_figure, save_figures

    methods = [m for m in METHODS if m.own or m.name == "classical"]
    log = stage.free(2.0)
    known = Scenario("free", "", lambda: [Scene("", log)], touched=False)
    outcome = run_scenario(known, methods, lambda name: None)
    figure = errors_figure([outcome], methods)
    assert [tick.get_text() for tick in figure.axes[0].get_yticklabels()] == ["free (99.9 %)"]
    save_figures(tmp_path, [outcome], methods, stage)
    assert {"wrench.png", "wrench_time.svg"} <= {path.name for path in tmp_path.iterdir()}
