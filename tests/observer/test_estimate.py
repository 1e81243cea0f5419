# SPDX-License-Identifier: Apache-2.0
"""An estimate is a value: it can be compared, copied, stored and read."""

import copy
import pickle

import numpy as np
import pytest

import touchline as tl


@pytest.fixture(scope="module")
def estimates():
    observer = tl.Observer(tl.load_robot("sara"))
    rng = np.random.default_rng(0)
    signals = rng.normal(size=(5, 7)), rng.normal(size=(5, 7)), rng.normal(size=(5, 7))
    return observer.run(np.arange(5) * 1e-3, *signals, rng.normal(size=(5, 3, 6)))


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
