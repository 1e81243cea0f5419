# SPDX-License-Identifier: Apache-2.0
"""An estimate is a value: it can be compared, copied, stored and read."""

import copy
import gc
import inspect
import pickle
import sys

import numpy as np
import pytest

import touchline as tl


@pytest.fixture(scope="module")
def estimates():
    observer = tl.Observer(tl.load_robot("sara"))
    rng = np.random.default_rng(0)
    signals = rng.normal(size=(5, 7)), rng.normal(size=(5, 7)), rng.normal(size=(5, 7))
    return observer.run(np.arange(5) * 1e-3, *signals, rng.normal(size=(5, 3, 6)))


@pytest.fixture
def observer():
    return tl.Observer(tl.load_robot("sara"))


@pytest.fixture
def samples(observer):
    """Of an arm that moves, as arrays of float64."""
    rng = np.random.default_rng(1)
    n, k = len(observer.robot.joint_names), len(observer.robot.sensor_names)
    return [
        (i * 1e-3, *(rng.normal(size=size) for size in (n, n, n, (k, 6)))) for i in range(1, 30)
    ]


@pytest.mark.parametrize("make", [tl.Observer, tl.Pipeline])
def test_an_update_is_the_same_however_its_signals_are_given(samples, make):
    """Arrays of float64 go to the core at once, all else by way of Python."""
    at_once, listed, named = (make(tl.load_robot("sara")) for _ in range(3))
    for time, *signals in samples:
        names = dict(zip(("q", "qd", "tau", "wrench"), signals, strict=True))
        result = at_once.update(time, *signals)
        assert result == listed.update(time, *(x.tolist() for x in signals))
        assert result == named.update(time=time, **names)


@pytest.mark.parametrize("make", [tl.Observer, tl.Pipeline])
def test_a_class_may_take_samples_in_another_way(samples, make):
    class Doubled(make):
        def update(self, time, q, qd, tau=None, wrench=None):
            return super().update(time, q, qd, 2.0 * tau, wrench)

    ours, plain = Doubled(tl.load_robot("sara")), make(tl.load_robot("sara"))
    for time, q, qd, tau, wrench in samples:
        assert ours.update(time, q, qd, tau, wrench) == plain.update(time, q, qd, 2.0 * tau, wrench)


@pytest.mark.parametrize("make", [tl.Observer, tl.Pipeline])
def test_update_tells_what_it_takes(make):
    assert list(inspect.signature(make.update).parameters)[1:] == [
        "time",
        "q",
        "qd",
        "tau",
        "wrench",
    ]
    assert inspect.getdoc(make.update).startswith("Takes one sample")
    with pytest.raises(TypeError, match="q"):
        make(tl.load_robot("sara")).update(0.0)


def test_an_estimate_lives_as_long_as_its_parts(observer, samples):
    held = [observer.update(*sample).segment_wrench for sample in samples]
    kept = [part.copy() for part in held]
    gc.collect()
    more = [observer.update(time + 1.0, *signals) for time, *signals in samples]
    assert len(more) == len(held)
    for part, copied in zip(held, kept, strict=True):
        np.testing.assert_array_equal(part, copied)


def test_updates_leave_no_references_behind(observer, samples):
    def count():
        gc.collect()
        return sys.getrefcount(observer._slices), len(gc.get_objects())

    def work(shift):
        for time, *signals in samples:
            estimate = observer.update(time + shift, *signals)
            _ = estimate.tau_ext, estimate.sensor_wrench, estimate.health, estimate.rows
            with pytest.raises(ValueError, match="shape"):
                observer.update(time + shift, signals[0][:2], *signals[1:])

    work(0.0)
    before = count()
    for shift in (1.0, 2.0, 3.0):
        work(shift)
    after = count()
    assert after[0] == before[0] and after[1] < before[1] + len(samples)


def test_rows_of_one_sample_can_be_changed_and_exchanged(observer, samples):
    estimate = observer.update(*samples[0])
    estimate.rows[0] = 7.0
    assert estimate.tau_ext[0] == 7.0
    estimate.rows = np.zeros_like(estimate.rows)
    assert not estimate.tau_ext.any() and estimate.health == 0
    short = estimate.like(np.zeros(3))
    with pytest.raises(TypeError, match="columns"):
        _ = short.tau_ext


@pytest.mark.parametrize("pick", [slice(None), 3])
def test_an_estimate_is_equal_to_its_copies(estimates, pick):
    estimate = estimates.like(estimates.rows[pick])
    for other in (copy.deepcopy(estimate), pickle.loads(pickle.dumps(estimate))):
        assert other == estimate
        other.rows[..., 0] += 1.0
        assert other != estimate
    assert estimate != 3


def test_its_parts_are_views_of_the_shapes_they_are_said_to_have(estimates):
    one = estimates.like(estimates.rows[2])
    for name, shape in {
        "tau_ext": (7,),
        "sensor_wrench": (3, 6),
        "segment_wrench": (3, 6),
        "segment_innovation": (3, 6),
        "joint_gap_std": (7,),
        "segment_gap_std": (3, 2),
    }.items():
        single, several = getattr(one, name), getattr(estimates, name)
        assert single.shape == shape and several.shape == (5, *shape)
        assert np.shares_memory(single, one.rows) and np.shares_memory(several, estimates.rows)
        np.testing.assert_array_equal(single, several[2])
        # Also of every second row, and after the estimate itself has gone.
        np.testing.assert_array_equal(
            getattr(estimates.like(estimates.rows[::2]), name), several[::2]
        )
    assert one.health == estimates.health[2] and isinstance(one.health, int)


def test_it_can_be_read(estimates):
    assert repr(estimates) == "Estimate of 5 samples"
    text = repr(estimates.like(estimates.rows[4]))
    assert text.startswith("Estimate(tau_ext=") and "health=1)" in text


def test_its_parts_keep_their_docstrings():
    assert tl.Estimate.tau_ext.__doc__.startswith("External joint torques (n,) [Nm]")
    assert tl.Estimate.segment_gap_std.__doc__.startswith("The same (m, 2) [N, Nm]")
