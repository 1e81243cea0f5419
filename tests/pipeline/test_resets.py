# SPDX-License-Identifier: Apache-2.0
"""Estimates that begin anew: each is counted, and its jump taken off leaves no step."""

import numpy as np
import pytest
from free_motion import exact_loads

import touchline as tl

RATE = 1000.0
BANDWIDTH = 100.0
LOAD = 3.0  # Nm on each joint, N and Nm on each axis, that stands there from the start
BRIDGED = 0.025  # s: no filter of that bandwidth goes on over more (2 / K, and some jitter)
NOISE = 1e-3  # Nm and N: a filter's step by noise alone is far below


@pytest.fixture(scope="module", params=["sara", "sara-full"])
def robot(request):
    return tl.load_robot(request.param)


def held(robot, seconds, seed=0):
    """Stamps and signals of an arm that stands still under a constant load."""
    count = round(seconds * RATE)
    time = np.arange(count) / RATE
    q = np.tile(np.linspace(0.3, 0.9, len(robot.joint_names)), (count, 1))
    tau, wrench = exact_loads(robot, time, q, np.zeros_like(q))
    rng = np.random.default_rng(seed)
    tau += LOAD + rng.normal(0.0, NOISE, tau.shape)
    wrench += LOAD + rng.normal(0.0, NOISE, wrench.shape)
    return time, q, np.zeros_like(q), tau, wrench


def estimates(robot, estimate):
    """Columns (N,) or (N, 6) of what is counted, by name."""
    columns = {name: estimate.tau_ext[:, [j]] for j, name in enumerate(robot.joint_names)}
    for g, name in enumerate(robot.segment_names):
        columns[name] = estimate.segment_wrench[:, g]
    return columns


def check_continuous(time, columns, changes):
    """No estimate moves by more than its filter does, but where a reset is told.

    Returns the largest step that a reset has made.
    """
    largest = 0.0
    for name, values in columns.items():
        known = np.flatnonzero(np.isfinite(values).all(axis=1))
        if len(known) < 2:
            continue
        jumps = np.zeros_like(values)
        told = {c.sample: c.jump for c in changes if c.name == name}
        for sample, jump in told.items():
            jumps[sample] = jump
        whole = values - np.cumsum(jumps, axis=0)
        steps = np.abs(np.diff(whole[known], axis=0))
        seconds = np.diff(time[known])[:, None]
        reach = np.ptp(np.vstack([values[known], np.zeros((1, values.shape[1]))]), axis=0)
        follows = np.where((seconds > 0.0) & (seconds < BRIDGED), seconds, 0.0)
        most = 1.05 * -np.expm1(-BANDWIDTH * follows) * reach + 10 * NOISE
        at_reset = np.isin(known[1:], list(told))
        assert (steps[~at_reset] <= most[~at_reset]).all(), name
        assert (steps[at_reset] < 1e-9).all(), name
        if told:
            largest = max(largest, *(max(map(abs, jump)) for jump in told.values()))
    return largest


@pytest.mark.parametrize("seed", range(6))
def test_an_estimate_less_its_jumps_is_continuous(robot, seed):
    """Random gaps, channels and sensors that drop out for a while, a clock that is set back."""
    rng = np.random.default_rng([7, seed])
    time, q, qd, tau, wrench = held(robot, 1.5, seed)
    for _ in range(2):
        begin = int(rng.integers(200, len(time) - 300))
        time[begin:] += 10 ** rng.uniform(-2.5, 0.0)
    if seed % 2:
        time[int(rng.integers(600, 900)) :] -= 0.4
    for _ in range(3):
        begin, length = int(rng.integers(200, 1200)), int(10 ** rng.uniform(0.0, 2.3))
        if rng.integers(0, 2):
            tau[begin : begin + length, rng.integers(0, tau.shape[1])] = np.nan
        else:
            wrench[begin : begin + length, rng.integers(0, wrench.shape[1])] = np.nan
    pipeline = tl.Pipeline(robot)
    estimate, _ = pipeline.run(time, q, qd, tau, wrench)
    largest = check_continuous(time, estimates(robot, estimate), pipeline.resets)
    assert not pipeline.resets or largest > 0.5 * LOAD


def test_a_jump_that_is_not_told_is_found(robot):
    time, *signals = held(robot, 1.0)
    time[600:] += 0.5
    estimate, _ = tl.Pipeline(robot).run(time, *signals)
    with pytest.raises(AssertionError):
        check_continuous(time, estimates(robot, estimate), ())


def test_a_long_gap_resets_all_once_and_a_short_one_nothing(robot):
    time, *signals = held(robot, 1.0)
    time[300:] += 0.01
    time[600:] += 0.5
    pipeline = tl.Pipeline(robot)
    estimate, _ = pipeline.run(time, *signals)
    columns = estimates(robot, estimate)
    known = [name for name, values in columns.items() if np.isfinite(values[-1]).all()]
    assert [(c.name, c.sample, c.count) for c in pipeline.resets] == [(n, 600, 1) for n in known]
    for change in pipeline.resets:
        np.testing.assert_allclose(change.jump, -columns[change.name][599], atol=1e-12)
    check_continuous(time, columns, pipeline.resets)


def test_an_undisturbed_recording_has_no_reset(robot):
    pipeline = tl.Pipeline(robot)
    pipeline.run(*held(robot, 0.5))
    assert pipeline.resets == ()
    sample = [signal[-1] for signal in held(robot, 0.5)]
    sample[0] += 1.0 / RATE
    resets = pipeline.update(*sample).resets
    assert [r.name for r in resets] == [*robot.joint_names, *robot.segment_names]
    assert all(r.count == 0 and not any(r.jump) for r in resets)
    assert {len(r.jump) for r in resets} == {1, 6}


@pytest.mark.parametrize("begin_anew", ["reset", "tare"])
def test_counts_go_on_where_a_pipeline_begins_anew(robot, begin_anew):
    time, *signals = held(robot, 1.0)
    pipeline = tl.Pipeline(robot)
    first, _ = pipeline.run(time, *signals)
    for count in (1, 2):
        getattr(pipeline, begin_anew)()
        second, _ = pipeline.run(time + count, *signals)
        before, after = estimates(robot, first), estimates(robot, second)
        known = [name for name, values in before.items() if np.isfinite(values[-1]).all()]
        assert [(c.name, c.count) for c in pipeline.resets] == [(n, count) for n in known]
        for c in pipeline.resets:
            jump = after[c.name][c.sample] - before[c.name][-1]
            np.testing.assert_allclose(c.jump, jump, atol=1e-12)
        first = second


def test_a_lost_sensor_is_told_as_it_goes_and_as_it_is_back(robot):
    """The segment inboard of it takes its load over; the joints keep theirs."""
    time, q, qd, tau, wrench = held(robot, 1.2)
    if len(robot.sensor_names) < 2:
        pytest.skip("no segment to merge with")
    wrench[400:700, -1] = np.nan
    pipeline = tl.Pipeline(robot)
    estimate, _ = pipeline.run(time, q, qd, tau, wrench)
    inboard = robot.segment_names[0]
    told = [c for c in pipeline.resets if c.name == inboard]
    assert [c.count for c in told] == [1, 2]
    assert 400 < told[0].sample < 700 < told[1].sample
    check_continuous(time, estimates(robot, estimate), pipeline.resets)


def test_samples_one_by_one_are_told_the_same(robot):
    time, q, qd, tau, wrench = held(robot, 0.6)
    time[200:] += 0.3
    wrench[350:500, -1] = np.nan
    whole, single = tl.Pipeline(robot), tl.Pipeline(robot)
    whole.run(time, q, qd, tau, wrench)
    counts: dict[str, int] = {}
    told = []
    for i in range(len(time)):
        for r in single.update(time[i], q[i], qd[i], tau[i], wrench[i]).resets:
            if r.count != counts.get(r.name, 0):
                told.append((i, r.name, r.count, r.jump))
            counts[r.name] = r.count
    assert told == [(c.sample, c.name, c.count, c.jump) for c in whole.resets]
    assert told
