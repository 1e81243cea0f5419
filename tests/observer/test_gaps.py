# SPDX-License-Identifier: Apache-2.0
"""Lost samples: the momentum is known at both ends, so that a short gap is integrated over."""

import gzip
import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion import Recording, ramp
from robots import describe, random_mechanism

import touchline as tl
from touchline.health import Health
from touchline.model.robot import Robot
from touchline.simulation.scenario import three_touches
from touchline.trials.touches import resting_signals

ROOT = Path(__file__).parents[2]
DATA = Path(os.environ.get("TOUCHLINE_DATA", ROOT.parent / "shared" / "data"))
FORCE, POINT = np.array([10.0, -12.0, 12.0]), np.array([0.3, -0.2, 0.6])  # 20 N


def make_robot():
    mechanism = random_mechanism(np.random.default_rng(11), chain=True)
    return Robot(describe(mechanism, (("base", "link0"), ("tip", "link7"))), mechanism)


ROBOT = make_robot()


def pushed(rate=1000.0, seconds=0.7):
    """A moving arm, pushed at its tip from 0.25 s to 0.5 s; exact sensors."""
    contact = ("tip", lambda t: POINT, lambda t: FORCE * ramp(t, 0.25, 0.02, 0.5))
    return Recording(ROBOT, np.arange(0.0, seconds, 1.0 / rate), [contact]).signals()


PUSH = pushed()


def cut(signals, begin, length):
    """Without the samples from `begin` to `begin + length` [s]; and the first one after them."""
    time = signals[0]
    first = np.searchsorted(time, begin)
    after = np.searchsorted(time, time[first] + length - 1e-9)
    keep = np.ones(len(time), bool)
    keep[first:after] = False
    return tuple(signal[keep] for signal in signals), keep, after


def run(signals, bandwidth, robot=ROBOT, **options):
    return tl.Observer(robot, bandwidth, **options).run(*signals)


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    begin=st.floats(0.2, 0.6),
    length=st.sampled_from([0.004, 0.01, 0.02]),
    bandwidth=st.sampled_from([25.0, 60.0, 100.0]),
    method=st.sampled_from(["segment", "paper"]),
)
def test_a_push_is_felt_through_a_gap(begin, length, bandwidth, method):
    whole = run(PUSH, bandwidth, method=method)
    signals, keep, after = cut(PUSH, begin, length)
    estimate = run(signals, bandwidth, method=method)
    health = np.zeros(len(keep), int)
    health[keep] = estimate.health
    settled = 5.0 / bandwidth + 2e-3
    assert health[after] & Health.GAP and np.count_nonzero(health & Health.GAP) == 1
    assert (health[PUSH[0] > settled] & ~Health.GAP == 0).all()
    # Within 5 % where the force is steady; where it changes within the gap, its mean is in doubt by
    # half of the change, which is told.
    error = np.abs(estimate.segment_wrench - whole.segment_wrench[keep])
    force = np.linalg.norm(error[..., :3], axis=-1)
    steady = all(not begin - 1e-3 < t < begin + length for t in (0.25, 0.27, 0.5, 0.52))
    if steady:
        assert np.nanmax(force[PUSH[0][keep] > settled]) < 0.05 * np.linalg.norm(FORCE)
    assert (whole.segment_gap_std == 0.0).all()
    told = estimate.segment_gap_std[..., 0]
    assert (force <= 2.0 * told + 0.02)[PUSH[0][keep] > settled].all()


def test_a_gap_is_bridged_up_to_two_time_constants():
    for bandwidth, longest in ((25.0, 0.08), (60.0, 2 / 60), (100.0, 0.02), (200.0, 0.01)):
        for length, bit in ((longest - 1e-3, 0), (longest + 3e-3, Health.SETTLING)):
            signals, keep, after = cut(PUSH, 0.4, length)
            row = np.count_nonzero(keep[:after])
            health = run(signals, bandwidth).health
            assert health[row] == Health.GAP | bit
            assert health[row + 1] == bit


def test_five_milliseconds_at_8_khz_are_bridged():
    signals = pushed(8000.0, 0.45)
    whole = run(signals, 100.0)
    lossy, keep, _ = cut(signals, 0.35, 0.005)
    estimate = run(lossy, 100.0)
    error = np.abs(estimate.segment_wrench - whole.segment_wrench[keep])
    assert error[signals[0][keep] > 0.1, ..., :3].max() < 0.05
    assert not (estimate.health[-800:] & Health.SETTLING).any()


@pytest.mark.parametrize("bandwidth", [25.0, 100.0])
def test_the_doubt_grows_with_the_gap_and_fades(bandwidth):
    told = []
    for length in (0.005, 0.01, 0.02):
        signals, keep, after = cut(PUSH, 0.4, length)
        estimate = run(signals, bandwidth)
        row = np.count_nonzero(keep[:after])
        std = estimate.joint_gap_std
        assert (std[:row] == 0.0).all() and (std[row] > 0.0).all()
        assert (np.diff(std[row:], axis=0) <= 0.0).all() and (std[-1] < 0.01 * std[row]).all()
        told.append(std[row].max())
    assert told[0] < told[1] < told[2]


def test_the_doubt_is_told_also_of_rows_that_only_miss_their_own_readings():
    time, q, qd, tau, wrench = PUSH
    lossy = tau.copy()
    lossy[400:410, 2] = np.nan
    whole, estimate = run(PUSH, 60.0), run((time, q, qd, lossy, wrench), 60.0)
    assert (estimate.health[410:] == 0).all()
    np.testing.assert_allclose(estimate.tau_ext[410:], whole.tau_ext[410:], atol=0.05)
    assert estimate.joint_gap_std[410, 2] > 0.0
    assert (np.delete(estimate.joint_gap_std, 2, axis=1) == 0.0).all()
    error = np.abs(estimate.tau_ext[410:, 2] - whole.tau_ext[410:, 2])
    assert (error <= 2.0 * estimate.joint_gap_std[410:, 2] + 1e-3).all()


def test_updates_through_gaps_are_those_of_a_run():
    keep = np.random.default_rng(3).random(len(PUSH[0])) > 0.3
    keep[200:215] = keep[300:304] = keep[450:530] = False
    signals = tuple(signal[keep] for signal in PUSH)
    rows = run(signals, 60.0).rows
    observer = tl.Observer(ROBOT, 60.0)
    for row, *sample in zip(rows, *signals, strict=True):
        np.testing.assert_array_equal(observer.update(*sample).rows, row)


@pytest.fixture(scope="module")
def sara():
    robot = tl.load_robot("sara")
    samples = three_touches(robot, speed=0.5, seconds=1.2).samples
    return robot, (samples.time, samples.q, samples.qd, samples.tau, samples.wrench)


@pytest.mark.parametrize("bandwidth", [25.0, 60.0, 100.0])
def test_contacts_stay_one_event_through_gaps(sara, bandwidth):
    robot, signals = sara
    rng = np.random.default_rng(int(bandwidth))
    keep = np.ones(len(signals[0]), bool)
    for begin in np.arange(0.16, 1.15, 0.12) + rng.uniform(0.0, 0.06, 9):
        first = np.searchsorted(signals[0], begin)
        keep[first : first + rng.choice([3, 10, 19])] = False
    pipeline = tl.Pipeline(robot, bandwidth)
    pipeline.run(*(signal[keep] for signal in signals))
    last = [event.segment for event in pipeline.events if event.cleared is None]
    assert sorted(last) == ["base", "handle", "wrist"]
    # One gap in 250 begins a second event beside the first for a few hundredths of a second.
    assert len(pipeline.events) <= 4


@pytest.mark.parametrize("method", ["rows", "scaled", "chi2", "glrt", "cusum"])
def test_gaps_are_no_contacts_for_any_test(method):
    robot = with_method(tl.load_robot("sara"), method)
    q = robot.ranges[0] + 0.4 * (robot.ranges[1] - robot.ranges[0])
    rng = np.random.default_rng(5)
    s = resting_signals(robot, q, [], 4.0, rng)
    keep = np.ones(len(s.time), bool)
    for begin in range(300, 3900, 97):
        keep[begin : begin + rng.choice([3, 10, 19])] = False
    pipeline = tl.Pipeline(robot, 100.0)
    pipeline.run(*(signal[keep] for signal in (s.time, s.q, s.qd, s.tau, s.wrench)))
    assert pipeline.events == []


def with_method(robot, method):
    detection = replace(robot.description.detection, method=(method,))
    return Robot(replace(robot.description, detection=detection), robot.mechanism)


def read_columns(path, names):
    with gzip.open(path, "rt") as file:
        log = np.genfromtxt(file, delimiter=",", names=True, deletechars="")[1:]
    return log["time"], *(np.stack([log[n] for n in columns], 1) for columns in names)


def errors_after_gaps(robot, signals, bandwidth, length, seed):
    """Largest error of any joint in the 0.2 s after each gap [Nm], and whether any restarted."""
    time, (whole, rng) = signals[0], (run(signals, bandwidth, robot), np.random.default_rng(seed))
    keep, after, begin = np.ones(len(time), bool), [], time[0] + 1.0
    while begin < time[-1] - 0.5:
        first = np.searchsorted(time, begin)
        after.append(np.searchsorted(time, time[first] + length - 1e-4))
        keep[first : after[-1]] = False
        begin += rng.uniform(0.9, 1.2)
    estimate = run(tuple(signal[keep] for signal in signals), bandwidth, robot)
    error = np.zeros(whole.tau_ext.shape)
    error[keep] = np.abs(estimate.tau_ext - whole.tau_ext[keep])
    settled = time[keep] > time[0] + 5.0 / bandwidth + 0.1
    assert not (estimate.health[settled] & Health.SETTLING).any()
    return np.array([error[i : np.searchsorted(time, time[i] + 0.2)].max() for i in after])


@pytest.mark.parametrize("length", [0.01, 0.02])
def test_a_real_kuka_in_motion(length, tmp_path):
    if not (DATA / "kuka_lwr4").exists():
        pytest.skip(f"no recordings at {DATA}: set TOUCHLINE_DATA")
    model = DATA / "kuka_lwr4" / "kuka_lwr4.urdf"
    (tmp_path / "kuka.yaml").write_text(f"name: kuka\nmodel: {model}\npackage_dirs: [{DATA}]\n")
    robot = tl.load_robot(tmp_path / "kuka.yaml")
    names = [[f"{signal}.{joint}" for joint in robot.joint_names] for signal in ("q", "qd", "tau")]
    for path in sorted((DATA / "kuka_lwr4").glob("*.csv.gz")):
        signals = read_columns(path, names)
        assert errors_after_gaps(robot, signals, 100.0, length, 1).max() < 0.1


@pytest.mark.parametrize("length", [0.01, 0.02])
def test_a_real_panda_that_is_touched(length):
    """Touches begin and end within gaps too, and torques of 200 Hz swing between two samples."""
    files = sorted(DATA.glob("panda_touches*/*.csv.gz"))
    if not files:
        pytest.skip(f"no recordings at {DATA}: set TOUCHLINE_DATA")
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arm's model")
    robot = tl.load_robot(ROOT / "examples" / "robots" / "panda_hand.yaml")
    names = [[f"{signal}{i}" for i in range(7)] for signal in ("q", "dq", "tau_J")]
    errors = [errors_after_gaps(robot, read_columns(p, names), 25.0, length, 1) for p in files]
    errors = np.concatenate(errors)
    print(f"\n{length} s: {len(errors)} gaps, {np.quantile(errors, [0.5, 0.95, 1.0]).round(3)} Nm")
    assert np.median(errors) < 0.05 and np.quantile(errors, 0.95) < 0.2
