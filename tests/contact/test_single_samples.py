# SPDX-License-Identifier: Apache-2.0
"""Noisy velocities: no single sample makes an event; a weak load that lasts is one."""

import numpy as np
import pytest
from shapes import chain

from touchline.observer.dynamics import gravity_loads
from touchline.pipeline.pipeline import Pipeline

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5])
ROBOT = chain((0.3,) * 6)
RATE = 200.0  # Hz
SECONDS = 6.0
SIGMA = 2e-4  # rad/s of velocity noise; told: 1e-4


def events(glitches=(), load=0.0, repeated=2, seed=0, sigma=SIGMA):
    """Of a standing arm that is logged with each packet `repeated` times.

    `sigma` [rad/s] is of velocities. In the packets that hold the times `glitches` [s] the velocity
    of joint 2 is 8 times `SIGMA` off; from 3.0 to 3.5 s it is loaded by `load` [Nm].
    """
    rng = np.random.default_rng(seed)
    n = round(SECONDS * RATE)
    time = np.arange(n) / RATE
    packets = np.arange(n) // repeated
    qd = rng.normal(size=(packets[-1] + 1, 6)) * sigma
    for glitch in glitches:
        qd[packets[round(glitch * RATE)], 1] += 8.0 * sigma
    still = gravity_loads(ROBOT, Q)
    tau = still.torque + 0.05 * rng.normal(size=(packets[-1] + 1, 6))[packets]
    wrench = np.tile(still.wrench, (n, 1, 1))
    tau[(time >= 3.0) & (time < 3.5), 1] -= load
    pipeline = Pipeline(ROBOT, period=1.0 / RATE)
    pipeline.run(time, np.tile(Q, (n, 1)), qd[packets], tau, wrench)
    return [(event.detected, event.cleared) for event in pipeline.events]


@pytest.mark.parametrize("repeated", [1, 2])
@pytest.mark.parametrize("seed", range(8))
def test_an_odd_velocity_is_no_event(repeated, seed):
    assert not events(glitches=(2.0, 2.8, 3.7, 4.5), repeated=repeated, seed=seed)


@pytest.mark.parametrize("seed", range(4))
def test_a_weak_load_that_lasts_is_one_event(seed):
    """0.25 Nm: four sigma of the noise of the residual."""
    ((begin, end),) = events(load=0.25, repeated=1, seed=seed)
    assert 3.0 < begin < 3.15
    assert 3.5 < end < 3.7


def test_noise_that_nobody_told_is_learnt():
    """Five times as noisy as told: not even the first moments are taken for a contact."""
    for seed in range(4):
        ((begin, end),) = events(load=0.5, repeated=1, seed=seed, sigma=5e-4)
        assert begin == pytest.approx(3.04, abs=0.04) and 3.5 < end < 3.7
