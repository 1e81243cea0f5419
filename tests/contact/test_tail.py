# SPDX-License-Identifier: Apache-2.0
"""Extreme values of distributions that are known."""

import numpy as np
import pytest
from scipy.stats import genpareto

from touchline.detector.tail import (
    Tail,
    alarm_levels,
    cluster_peaks,
    count_clusters,
    fit_excess,
    fit_tail,
    poisson_interval,
)


@pytest.mark.parametrize("shape", [-0.2, 0.0, 0.2])
def test_excesses_of_a_pareto_distribution(shape):
    x = genpareto.rvs(shape, scale=2.0, size=20_000, random_state=1)
    scale, found = fit_excess(x)
    assert found == pytest.approx(shape, abs=0.03)
    assert scale == pytest.approx(2.0, rel=0.04)


def test_the_fit_scales_with_its_unit():
    x = np.random.default_rng(0).exponential(1.0, 500)
    scale, shape = fit_excess(x)
    other, same = fit_excess(1e3 * x)
    assert other == pytest.approx(1e3 * scale, rel=1e-6)
    assert same == pytest.approx(shape, abs=1e-9)


@pytest.mark.parametrize("rate", [30.0, 1.0, 0.1])
def test_the_threshold_of_a_normal_series(rate):
    # Independent samples at 10 Hz: rate per hour = 36000 P(|x| > h).
    from scipy.stats import norm

    hours, errors, covered = 4.0, [], 0
    exact = norm.isf(rate / 36000 / 2)
    for seed in range(20):
        x = np.abs(np.random.default_rng(seed).normal(size=int(36000 * hours)))
        tail = fit_tail(x, hours, 0)
        low, high = tail.interval(rate)
        covered += low <= exact <= high
        errors.append(tail.threshold(rate) - exact)
        assert tail.extrapolates(rate) == (rate * hours < 1.0)
    assert abs(np.mean(errors)) < 0.1
    assert covered >= 16


def test_rate_and_threshold_are_inverse():
    for shape in (-0.2, 0.0, 0.3):
        tail = Tail(3.0, 100.0, 0.5, shape, 400, 4.0)
        for rate in (50.0, 1.0, 0.01):
            assert tail.rate(tail.threshold(rate)) == pytest.approx(rate)
        assert tail.threshold(1e4) == 3.0


def test_clusters_count_once():
    series = np.array([0, 2, 3, 0, 2.5, 0, 0, 0, 0, 4, np.nan, 0, 0, 0, 0, 2.0])
    peaks, at = cluster_peaks(series, 1.0, 2)
    assert peaks.tolist() == [3.0, 4.0, 2.0]
    assert at.tolist() == [2, 9, 15]
    assert len(cluster_peaks(series, 1.0, 1)[0]) == 4
    assert len(cluster_peaks(series, 9.0, 2)[0]) == 0


@pytest.mark.parametrize("gap", [0, 1, 3, 10])
def test_below_the_kth_level_there_are_k_alarms(gap):
    rng = np.random.default_rng(2)
    slow = np.convolve(rng.normal(size=5000), np.ones(40) / 6, "same")  # lasts for many samples
    series = np.abs(slow + 0.3 * rng.normal(size=5000))
    series[[700, 2000]] = np.nan
    levels = alarm_levels(series, gap)
    assert (np.diff(levels) <= 0).all()
    for k in range(1, 60):
        assert count_clusters(series, np.nextafter(levels[k - 1], 0.0), gap) == k
        assert count_clusters(series, levels[k - 1], gap) < k


def test_a_tail_foresees_the_alarms_of_what_lasts():
    # Excursions of a second with many peaks each: at high levels there are several alarms in one.
    gap, hours, blocks = 10, 4.0, 50 * 3600
    decay = np.exp(-0.02 / 1.0)
    counts, wanted = 0, 20.0
    for seed in range(6):
        rng = np.random.default_rng(seed)
        from scipy.signal import lfilter

        slow = lfilter([np.sqrt(1 - decay**2)], [1.0, -decay], rng.normal(size=int(hours * blocks)))
        series = np.abs(slow) + 0.2 * np.abs(rng.normal(size=len(slow)))
        tail = fit_tail(series, hours, gap)
        assert tail is not None
        counts += count_clusters(series, tail.threshold(wanted), gap)
    assert counts == pytest.approx(6 * hours * wanted, rel=0.08)


def test_too_short_a_series_has_no_tail():
    assert fit_tail(np.arange(20.0), 0.01, 1) is None


def test_poisson_intervals():
    assert poisson_interval(0) == pytest.approx((0.0, 3.689), abs=1e-3)
    assert poisson_interval(10) == pytest.approx((4.795, 18.39), abs=1e-2)
