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
SIGMA = 5e-4  # rad/s of velocity noise; told: 1e-4


def events(glitches=(), load=0.0, repeated=2, seed=0):
    """Of a standing arm that is logged with each packet `repeated` times.

    In the packets that hold the times `glitches` [s] the velocity of joint 2 is 8 sigma off; from
    3.0 to 3.5 s it is loaded by `load` [Nm].
    """
    rng = np.random.default_rng(seed)
    n = round(SECONDS * RATE)
    time = np.arange(n) / RATE
    packets = np.arange(n) // repeated
    qd = rng.normal(size=(packets[-1] + 1, 6)) * SIGMA
    for glitch in glitches:
        qd[packets[round(glitch * RATE)], 1] += 8.0 * SIGMA
    still = gravity_loads(ROBOT, Q)
    tau = still.torque + 0.05 * rng.normal(size=(packets[-1] + 1, 6))[packets]
    wrench = np.tile(still.wrench, (n, 1, 1))
    tau[(time >= 3.0) & (time < 3.5), 1] -= load
    pipeline = Pipeline(ROBOT, period=1.0 / RATE)
    pipeline.run(time, np.tile(Q, (n, 1)), qd[packets], tau, wrench)
    return [(event.detected, event.cleared) for event in pipeline.events]


@pytest.mark.parametrize("repeated", [1, 2])
def test_an_odd_velocity_is_no_event(repeated):
    assert not events(glitches=(2.0, 2.8, 3.7, 4.5), repeated=repeated)


def test_two_odd_velocities_one_after_the_other_are_an_event():
    assert events(glitches=(2.0, 2.01, 2.02))
