# SPDX-License-Identifier: Apache-2.0
"""Wrong use is told: sizes, surfaces of another robot, a period that the stamps deny."""

import numpy as np
import pytest
from free_motion import free_motion
from robots import random_robot

import touchline as tl
from touchline.health import Health
from touchline.localizer.localizer import Localizer
from touchline.localizer.skin import Skin
from touchline.native import core
from touchline.observer.observer import Observer


@pytest.fixture(scope="module")
def sara():
    return tl.load_robot("sara")


WRONG = [
    ("q", np.zeros(6)),
    ("q", np.zeros((7, 1))),
    ("qd", np.zeros(8)),
    ("tau", np.zeros(3)),
    ("wrench", np.zeros((2, 5))),
    ("wrench", np.zeros(12)),
    ("q", "seven"),
    ("qd", [0.0, 1.0]),
]


@pytest.mark.parametrize(("name", "value"), WRONG)
def test_arrays_of_a_wrong_size_are_refused_by_name(sara, name, value):
    k = len(sara.sensor_names)
    good = {"q": np.zeros(7), "qd": np.zeros(7), "tau": np.zeros(7), "wrench": np.zeros((k, 6))}
    pipeline = tl.Pipeline(sara)
    with pytest.raises(ValueError, match=rf"^{name} "):
        pipeline.update(0.0, **(good | {name: value}))
    with pytest.raises(ValueError, match=rf"^{name} "):
        pipeline.run([0.0], **{key: [x] for key, x in (good | {name: value}).items()})
    assert pipeline.update(0.0, **good).health & ~Health.SETTLING == 0


def test_what_is_no_time_is_refused(sara):
    n, k = 7, len(sara.sensor_names)
    pipeline = tl.Pipeline(sara)
    with pytest.raises(ValueError, match="time"):
        pipeline.update("noon", np.zeros(n), np.zeros(n), np.zeros(n), np.zeros((k, 6)))
    with pytest.raises(ValueError, match="time has shape"):
        pipeline.run(0.0, np.zeros(n), np.zeros(n))


def test_surfaces_of_another_robot_are_refused(sara):
    other, skin = random_robot(3), Skin(sara)
    with pytest.raises(ValueError, match="skin is that of another robot"):
        tl.Pipeline(other, skin=skin)
    with pytest.raises(ValueError, match="skin is that of another robot"):
        Localizer(Observer(other), skin=skin)


@pytest.mark.parametrize("period", [0.0, -1e-3, np.nan, np.inf])
def test_a_period_that_is_none_is_refused(sara, period):
    with pytest.raises(ValueError, match="period"):
        tl.Pipeline(sara, period=period)


def bits(robot, rate, period, jitter=0.0):
    """Health bits of a recording in one call, checked against those sample by sample."""
    s = free_motion(robot, seconds=400 / rate, rate=rate)
    rng = np.random.default_rng(0)
    s.time[:] += rng.uniform(-jitter, jitter, len(s)) / rate
    whole, _ = tl.Pipeline(robot, period=period).run(s.time, s.q, s.qd, s.tau, s.wrench)
    live = tl.Pipeline(robot, period=period)
    single = [live.update(*x).health for x in zip(s.time, s.q, s.qd, s.tau, s.wrench, strict=True)]
    np.testing.assert_array_equal(whole.health, single)
    return (whole.health & Health.PERIOD) != 0


@pytest.mark.parametrize(("rate", "period"), [(200.0, 1e-3), (1000.0, 5e-3), (700.0, 1e-3)])
def test_stamps_that_deny_the_period_are_told(sara, rate, period):
    told = bits(sara, rate, period)
    assert not told[:64].any() and told[70:].all()


@pytest.mark.parametrize("jitter", [0.0, 0.4])
def test_stamps_that_confirm_the_period_are_no_matter_though_they_jitter(sara, jitter):
    assert not bits(sara, 200.0, 5e-3, jitter).any()


def test_a_robot_whose_parts_do_not_fit_is_refused(sara):
    def broken(change):
        robot = tl.Pipeline(sara)._native()
        change(robot)
        with pytest.raises(ValueError, match="^robot: ") as told:
            core.Pipeline(robot, core.Tuning())
        return str(told.value)

    assert "name for each joint" in broken(lambda r: setattr(r, "joint_names", []))
    assert "segment" in broken(lambda r: setattr(r, "segment_names", ["root"]))
    assert "surface" in broken(lambda r: setattr(r, "links", []))
    assert "segment by segment" in broken(lambda r: setattr(r, "rows", r.rows[::-1]))
    assert "node" in broken(lambda r: setattr(r, "nodes", r.nodes[:2]))
