# SPDX-License-Identifier: Apache-2.0
"""Samples averaged over blocks."""

import numpy as np

from touchline.check.averages import averaged
from touchline.observer.samples import Samples


def samples(time: np.ndarray) -> Samples:
    rng = np.random.default_rng(0)
    q, qd, tau = (rng.normal(size=(len(time), 2)) for _ in range(3))
    return Samples(time, q, qd, tau, rng.normal(size=(len(time), 1, 6)))


def test_blocks_are_means_of_their_samples() -> None:
    given = samples(np.arange(1000) * 1e-3)
    (found,) = averaged([given], 100.0)
    assert len(found) == 100
    np.testing.assert_allclose(found.time, given.time.reshape(100, 10).mean(axis=1))
    np.testing.assert_allclose(found.tau, given.tau.reshape(100, 10, 2).mean(axis=1))
    np.testing.assert_allclose(found.wrench, given.wrench.reshape(100, 10, 1, 6).mean(axis=1))


def test_a_slow_recording_stays_as_it_is() -> None:
    given = samples(np.arange(50) * 0.02)
    (found,) = averaged([given], 100.0)
    assert found is given


def test_missing_values_are_left_out_of_their_mean() -> None:
    given = samples(np.arange(20) * 1e-3)
    given.tau[:10, 0] = np.nan
    given.tau[10:19, 0] = np.inf
    (found,) = averaged([given], 100.0)
    assert np.isnan(found.tau[0, 0])
    assert found.tau[1, 0] == given.tau[19, 0]
    np.testing.assert_allclose(found.tau[:, 1], given.tau[:, 1].reshape(2, 10).mean(axis=1))


def test_no_block_bridges_a_gap_or_goes_back_in_time() -> None:
    time = np.arange(40) * 1e-3
    time[15:] += 5.0
    time[33] = 0.0
    (found,) = averaged([samples(time)], 100.0)
    np.testing.assert_allclose(found.time, [4.5e-3, 5.0245])
