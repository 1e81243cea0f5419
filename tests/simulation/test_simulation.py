# SPDX-License-Identifier: Apache-2.0
"""The simulated robot against the observer, which shares no code with it."""

import numpy as np
import pytest

import touchline as tl
from touchline.simulation.contacts import Profile, ScriptedContact
from touchline.simulation.scenario import Run, free_motion, scripted
from touchline.simulation.truth import filter_truth

BANDWIDTH = 100.0


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


def estimate(robot, simulated):
    s = simulated.samples
    return tl.Observer(robot, BANDWIDTH).run(s.time, s.q, s.qd, s.tau, s.wrench)


def force_error(robot, simulated):
    """Largest force error [N] of each segment against the truth through the same filter."""
    by_link = {link: body.segment for body in robot.bodies for link in body.links}
    mean = simulated.truth.segment_wrench_mean(robot.segment_names, by_link)
    truth = filter_truth(mean, simulated.samples.time, BANDWIDTH)
    error = estimate(robot, simulated).segment_wrench - truth
    return np.linalg.norm(error[..., :3], axis=2).max(axis=0)


def test_contact_free_motion_leaves_no_residual(sara):
    simulated = free_motion(sara, seconds=2.0, speed=2.5)
    wrench = estimate(sara, simulated).segment_wrench
    assert np.abs(simulated.samples.qd).max() > 2.0
    assert np.abs(wrench).max() < 5e-3


@pytest.mark.parametrize("speed", [0.0, 1.5])
def test_three_simultaneous_forces_are_read_off_their_segments(sara, speed):
    contacts = [
        ScriptedContact("link3", [0.05, 0.0, 0.1], [20, 5, -7], Profile(0.1)),
        ScriptedContact("handle", [0.0, 0.03, 0.05], [-8, 5, 17], Profile(0.15)),
        ScriptedContact("tool", [0.0, 0.0, 0.1], [10, 5, 17], Profile(0.2, hold=0.2)),
    ]
    simulated = scripted(sara, contacts, seconds=0.8, speed=speed)
    assert np.linalg.norm(simulated.truth.force, axis=2).max(axis=0).min() > 19
    assert force_error(sara, simulated).max() < 0.05


def test_the_same_seed_gives_the_same_numbers(sara):
    first, second = (
        free_motion(sara, 0.1, settings=Run(seed=3, noise=tl_noise())) for _ in range(2)
    )
    for name in ("time", "q", "qd", "tau", "wrench"):
        np.testing.assert_array_equal(getattr(first.samples, name), getattr(second.samples, name))


def tl_noise():
    from touchline.simulation.noise import SensorNoise

    return SensorNoise()
