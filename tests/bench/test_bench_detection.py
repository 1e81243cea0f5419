# SPDX-License-Identifier: Apache-2.0
"""The detection benchmark: its motion is exact, its delays are counted from the onset."""

from dataclasses import replace

import numpy as np
import pytest

import touchline as tl
from touchline.bench.detection import classical as detection_classical
from touchline.bench.detection import files as detection_files
from touchline.bench.detection import run as detection
from touchline.bench.detection.classical import FastClassical, less_baseline
from touchline.bench.detection.drawing import draw
from touchline.bench.detection.outcome import Outcome
from touchline.bench.detection.pushes import AFTER, BEFORE, PushMaker, random_pushes
from touchline.bench.detection.tables import alarm_table, delay_table
from touchline.bench.detection.work import Setting, maker
from touchline.cli import main
from touchline.detector.calibration import Statistics, watching, with_methods
from touchline.detector.detector import Detector
from touchline.detector.tail import Tail
from touchline.observer.classical import ClassicalObserver
from touchline.observer.dynamics import from_world, inverse_dynamics
from touchline.observer.observer import Observer
from touchline.trials.free_motion import (
    MotionMaker,
    generator,
    imperfect,
    random_trajectory,
)


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def test_interpolated_loads_are_those_of_inverse_dynamics(sara):
    arm = imperfect(sara, 0.02, 1)
    maker = MotionMaker(sara, arm, 1000.0, 1.0)
    trajectory = random_trajectory(sara, generator(3))
    q, qd, loads = maker.loads(trajectory)
    some = slice(0, None, 37)
    exact = inverse_dynamics(arm, *(x[some] for x in trajectory(maker.time)))
    wanted = np.hstack([exact.torque, exact.wrench.reshape(len(exact.torque), -1)])
    np.testing.assert_allclose(loads[some], wanted, atol=1e-5)
    for found, exact in zip((q, qd), trajectory(maker.time), strict=False):
        np.testing.assert_allclose(found, exact, atol=1e-9)
    step = 1e-6
    ahead, behind = (trajectory(maker.time[some] + x)[0] for x in (step, -step))
    np.testing.assert_allclose((ahead - behind) / (2 * step), qd[some], atol=1e-6)
    assert np.abs(qd).max() <= 3.0


def test_a_push_is_felt_by_the_base_from_its_onset_on(sara):
    maker = PushMaker(MotionMaker(sara, sara, 1000.0, BEFORE + AFTER))
    (push,) = random_pushes(sara, 1, 5)
    with_it, without = (maker.samples(push, f, generator(1)) for f in (20.0, 0.0))
    off = with_it.wrench[:, 0, :3] - without.wrench[:, 0, :3]
    assert not off[: maker.first].any()
    np.testing.assert_allclose(np.linalg.norm(off[maker.first :], axis=1), 20.0, rtol=1e-9)


def test_delays_and_alarms_are_counted_against_the_tails():
    tail = Tail(2.0, 60.0, 1.0, 0.0, 600, 10.0)
    names = ("base", "wrist", "handle")
    limit = tail.threshold(1.0 / 3)
    pushes = np.zeros((3, 50, 1))
    pushes[0, 4:] = pushes[1, 9:] = 2 * limit
    blocks = np.zeros((20 * 180_000 // 20, 3, 1))  # an hour of 20 ms
    blocks[[100, 500, 501, 900], 0] = 2 * limit
    tested = Statistics(blocks, np.arange(len(blocks)) * 0.02, np.zeros(len(blocks), int), 1.0)
    forces = dict.fromkeys((2.0, 5.0, 10.0, 20.0, 50.0), pushes)
    o = Outcome(
        Setting("sara", 1000.0, 1e-3),
        ("glrt",),
        {n: {"glrt": tail} for n in names},
        tested,
        forces,
        10.0,
    )
    assert o.delays("glrt", 20.0, 1.0).tolist() == [3.5e-3, 8.5e-3, np.inf]
    assert o.alarms("glrt", 1.0) == 3  # two blocks side by side are one alarm
    assert "3 [0.62, 8.8]" in alarm_table([o])
    assert "33.3 %" in delay_table([o])


def test_files_keep_other_settings_and_can_be_drawn(tmp_path):
    tail = Tail(2.0, 60.0, 1.0, 0.0, 600, 10.0)
    blocks = np.zeros((9000, 3, 1))
    blocks[100, 0] = 50.0
    tested = Statistics(blocks, np.arange(9000) * 0.02, np.zeros(9000, int), 1.0)
    pushes = {f: np.full((4, 50, 1), f) for f in (2.0, 5.0, 10.0, 20.0, 50.0)}
    for velocity, hours in ((1e-3, 10.0), (2e-4, 10.0), (1e-3, 20.0)):
        tails = {n: {"glrt": replace(tail, hours=hours)} for n in ("base", "wrist", "handle")}
        setting = Setting("sara", 1000.0, velocity)
        o = Outcome(setting, ("glrt",), tails, tested, pushes, hours)
        detection_files.write(o, tmp_path)
    lines = detection_files.read(tmp_path / "tails.csv")
    found = [(x["velocity_noise"], x["hours"]) for x in lines if x["segment"] == "base"]
    assert found == [("0.0002", "10"), ("0.001", "20")]
    lines = detection_files.read(tmp_path / "roc.csv")
    at = [x for x in lines if float(x["alarms_wanted_per_hour"]) == 1.0]
    assert len(at) == 2 * 5 and {x["alarms_measured_per_hour"] for x in at} == {"1"}
    pytest.importorskip("matplotlib")
    draw(lines, tmp_path)
    drawn = (tmp_path / "roc.svg").read_text()
    assert "legend_" in drawn and "axes_2" in drawn  # one key for both settings


@pytest.fixture(scope="module", params=[1000.0, 8000.0])
def classical(request):
    setting = Setting("classical", request.param, 1e-3)
    make = maker(setting, 1.0)
    rng = generator(4)
    path = random_trajectory(make.robot, rng)
    return setting, make, path, make.samples(path, rng)


def test_the_quick_classical_route_is_the_classical_observer(classical):
    _, make, path, s = classical
    robot = make.robot
    slow = ClassicalObserver(robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
    torque, wrench, settled = FastClassical(make).run(path, s)
    np.testing.assert_allclose(torque, slow.tau_ext, atol=1e-10)
    assert not settled[0]
    assert settled[-1]
    poses = np.array([robot.sensor_poses(q) for q in s.q])
    for g, name in enumerate(robot.segment_names):
        T = poses[:, robot.sensor_names.index(name)]
        wanted = from_world(slow.segment_wrench[:, g], T[:, :3, :3], T[:, :3, 3])
        np.testing.assert_allclose(wrench[:, g], wanted, atol=3e-4)  # noise is above 0.05 N
        assert np.std(wanted) > 1e-2


def test_the_classical_rows_see_a_push_from_its_onset_on():
    setting, typical = Setting("classical", 1000.0, 2e-4), np.ones((2, 25))
    found = detection_classical.push_statistics(setting, typical, 50.0, range(2))
    assert found.shape == (2, round(AFTER * 1000.0) + 1, 2)
    before, after = found[:, 0], found[:, -20:].min(axis=1)
    assert (before < 5.0).all()
    assert (after > 10.0).all()


class Here:
    """Stands where a pool of processes would: the work is done in this one."""

    def __enter__(self):
        return self

    def __exit__(self, *error):
        pass

    def map(self, what, work, pieces):
        return [work(*piece) for piece in pieces]


@pytest.mark.parametrize(("layout", "methods"), [("joints", 5), ("classical", 2)])
def test_a_minute_is_calibrated_another_counted_and_pushes_are_found(layout, methods):
    o = detection.measure(Setting(layout, 1000.0, 1e-3), 1 / 60, 2, Here())
    assert len(o.methods) == methods and o.tested.hours == o.hours == pytest.approx(1 / 60)
    assert o.tested.blocks.shape[1:] == (3 if layout == "classical" else 1, methods)
    best, last = o.methods[-2 if layout == "classical" else 0], detection.FORCES[-1]
    assert {force: len(found) for force, found in o.pushes.items()} == dict.fromkeys(
        detection.FORCES, 2
    )
    weak, hard = (o.pushes[force].max(axis=(0, 1)) for force in (detection.FORCES[0], last))
    assert (hard > 2.0 * weak).all()
    assert o.alarms(best, 1.0) <= o.alarms(best, 100.0)


def outcome(setting):
    tail = Tail(2.0, 60.0, 1.0, 0.0, 600, 10.0)
    tested = Statistics(np.zeros((90, 3, 1)), np.arange(90) * 0.02, np.zeros(90, int), 1.0)
    pushes = {f: np.full((4, 50, 1), f) for f in detection.FORCES}
    tails = {n: {"glrt": tail} for n in ("base", "wrist", "handle")}
    return Outcome(setting, ("glrt",), tails, tested, pushes, 10.0)


def test_settings_are_printed_as_they_are_done_and_together(tmp_path, monkeypatch, capsys):
    pytest.importorskip("matplotlib")
    monkeypatch.setattr(detection, "Pool", Here)
    monkeypatch.setattr(detection, "measure", lambda setting, hours, trials, pool: outcome(setting))
    words = ["--observers", "extended", "--rates", "1000", "--out", str(tmp_path)]
    assert main(["bench", "detection", *words]) == 0
    told = capsys.readouterr().out
    assert told.count("observer") == 2 * 2 + 2 and "\ntogether\n" in told
    names = {path.name for path in tmp_path.iterdir()}
    assert {"roc.csv", "tails.csv", "roc.svg", "delay.svg"} <= names


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--hours", "0.01"], "hours"),
        (["--pushes", "0"], "pushes"),
        (["--velocity-noise", "0.5"], "allowed: 0.001, 0.0002"),
        (["--rates"], "is empty"),
    ],
)
def test_impossible_plans_are_told_before_the_work(words, told, capsys):
    assert main(["bench", "detection", *words]) == 2
    assert told in capsys.readouterr().err


def test_the_baseline_is_the_detectors(sara):
    maker = MotionMaker(sara, imperfect(sara, 0.02, 1), 1000.0, 8.0)
    s = maker.samples(random_trajectory(sara, generator(6)), generator(7))
    robot = with_methods(sara, "scaled")
    thresholds = watching(robot, 1e-3, {})
    rows = tuple(replace(row, baseline_limit=1e9) for row in thresholds.rows)
    detector = Detector(Observer(robot), replace(thresholds, rows=rows), 1e-3)
    left = detector.details(s.time, s.q, s.qd, s.tau, s.wrench, 1).residual
    estimate = Observer(robot).run(s.time, s.q, s.qd, s.tau, s.wrench)
    row = next(i for i, row in enumerate(thresholds.rows) if row.joint == 2)
    first = int(np.argmax(estimate.joint_settled[:, 2]))
    residual = estimate.segment_torque[first:, 2:3]
    known = left[np.isfinite(left[:, row]), row]
    np.testing.assert_allclose(
        less_baseline(residual, 1e-3, robot.description.detection.baseline.time)[:, 0],
        known[-len(residual) :],
        atol=1e-9,
    )
