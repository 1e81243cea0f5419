# SPDX-License-Identifier: Apache-2.0
"""An arm that is not as told says so: what stands there without a touch, and noise beyond told."""

import numpy as np
import pytest
from shapes import chain

from touchline import Health
from touchline.observer.dynamics import contact_loads, gravity_loads
from touchline.pipeline.pipeline import Pipeline
from touchline.result.standing import standing_lines, unlike_told

Q = np.array([0.3, -0.5, 0.8, 0.4, -0.6, 0.5])
ROBOT = chain((0.3,) * 6)
RATE, SECONDS = 1000.0, 3.0  # Hz, s
STANDING = Health.OFFSET | Health.NOISY


def watched(bias=0.0, noise=1.0, push=0.0, seed=0, blind=0.0):
    """A standing arm with `noise` times what is told.

    Joint 2 reads `bias` [Nm] too little. From 1.5 s on link 4 is pushed down by `push` [N]. With
    `blind` [s], nothing is received for so long after each half second, and a push ends in there.
    """
    rng = np.random.default_rng(seed)
    n = round(SECONDS * RATE)
    time, still = np.arange(n) / RATE, gravity_loads(ROBOT, Q)
    pushed = time % 0.5 >= 0.15 if blind else time >= 1.5
    told = ROBOT.description.noise
    tau = still.torque + noise * np.array(told.tau) * rng.normal(size=(n, 6))
    qd = noise * np.array(told.qd) * rng.normal(size=(n, 6))
    tau[:, 1] -= bias
    wrench = np.tile(still.wrench, (n, 1, 1))
    force = np.array([0.0, 0.0, -push])
    place = ROBOT.T_world_links(Q)["link4"][:3, 3]
    touch = contact_loads(ROBOT, Q[None], "link4", np.r_[force, np.cross(place, force)][None])
    tau[pushed] -= touch.torque[0]
    wrench[pushed] -= touch.wrench[0]
    time = time + blind * np.floor(time / 0.5)
    pipeline = Pipeline(ROBOT, period=1.0 / RATE)
    estimate, _ = pipeline.run(time, np.tile(Q, (n, 1)), qd, tau, wrench)
    return pipeline, estimate.health.astype(int)


@pytest.mark.parametrize("seed", range(4))
def test_an_arm_that_is_as_told_stands_on_nothing(seed):
    pipeline, health = watched(seed=seed)
    assert not (health & STANDING).any()
    assert not unlike_told(pipeline.standing) and not standing_lines(pipeline.standing)
    assert all(s.start == s.now == 0.0 and s.noise == 1.0 for s in pipeline.standing)


@pytest.mark.parametrize("bias", [2.0, -3.0])
def test_an_offset_of_the_start_is_no_touch_and_is_told(bias):
    pipeline, health = watched(bias=bias)
    assert not any(event.status == "located" for event in pipeline.events)
    assert (health[-1000:] & Health.OFFSET).all() and not (health & Health.NOISY).any()
    (standing,) = unlike_told(pipeline.standing)
    assert standing.signal == ROBOT.joint_names[1] and standing.unit == "Nm"
    assert standing.start == pytest.approx(bias, abs=0.1)
    assert standing.now == pytest.approx(bias, abs=0.1)
    (line,) = standing_lines(pipeline.standing)
    assert f"{standing.signal} {standing.start:+.2f} Nm" in line and "touchline calibrate" in line


def test_a_push_that_is_held_is_no_offset():
    pipeline, health = watched(push=15.0)
    (event,) = pipeline.events
    assert event.detected == pytest.approx(1.5, abs=0.05) and event.cleared is None
    assert not (health & STANDING).any()


def test_pushes_that_end_where_nothing_is_received_are_no_noise():
    pipeline, health = watched(push=15.0, blind=1.0)
    assert not (health & STANDING).any()
    began = [event.detected % 1.5 for event in pipeline.events]
    assert began == pytest.approx([0.16] * 6, abs=0.02)


@pytest.mark.parametrize("factor", [3.0, 10.0])
def test_noise_beyond_told_is_named_with_its_size(factor):
    pipeline, health = watched(noise=factor)
    assert not pipeline.events
    assert (health[-1000:] & Health.NOISY).all() and not (health & Health.OFFSET).any()
    joints = [s for s in pipeline.standing if s.signal in ROBOT.joint_names]
    assert all(s.noise == pytest.approx(factor, rel=0.4) for s in joints)
    (line,) = standing_lines(pipeline.standing)
    assert "noise is larger" in line and "touchline calibrate" in line


def warming_up(drift, begin, end):
    """Ten minutes of a standing arm whose joint 2 reads `drift` [Nm] less in the end than at first.

    Link 4 is pushed down by 15 N from `begin` to `end` [s].
    """
    rng = np.random.default_rng(0)
    n, rate = 60000, 100.0
    time, still, told = np.arange(n) / rate, gravity_loads(ROBOT, Q), ROBOT.description.noise
    tau = still.torque + np.array(told.tau) * rng.normal(size=(n, 6))
    qd = np.array(told.qd) * rng.normal(size=(n, 6))
    tau[:, 1] -= drift * time / time[-1]
    wrench = np.tile(still.wrench, (n, 1, 1))
    force = np.array([0.0, 0.0, -15.0])
    place = ROBOT.T_world_links(Q)["link4"][:3, 3]
    touch = contact_loads(ROBOT, Q[None], "link4", np.r_[force, np.cross(place, force)][None])
    pushed = (time >= begin) & (time < end)
    tau[pushed] -= touch.torque[0]
    wrench[pushed] -= touch.wrench[0]
    pipeline = Pipeline(ROBOT, period=1.0 / rate)
    estimate, _ = pipeline.run(time, np.tile(Q, (n, 1)), qd, tau, wrench)
    return pipeline, estimate.health.astype(int)


def test_a_sensor_that_warms_up_is_followed_and_told():
    pipeline, health = warming_up(1.0, 400.0, 460.0)
    (event,) = pipeline.events  # held for a minute, in which the drift goes on
    assert event.detected == pytest.approx(400.0, abs=0.05)
    assert event.cleared == pytest.approx(460.0, abs=0.6)
    assert event.status == "located" and event.link == "link4"
    told = health & Health.OFFSET
    assert told[-1] and not told[: len(told) // 10].any()
    (standing,) = unlike_told(pipeline.standing)
    assert standing.signal == ROBOT.joint_names[1] and standing.start == standing.now == 0.0
    assert standing.drift == pytest.approx(1.0, abs=0.2)  # it lags by a minute
    (line,) = standing_lines(pipeline.standing)
    assert "slow drift" in line and f"{standing.drift:+.2f} Nm" in line


def test_a_drift_is_followed_only_so_far():
    pipeline, _ = warming_up(6.0, 700.0, 700.0)
    most = {s.signal: 10.0 * s.threshold for s in pipeline.standing}[ROBOT.joint_names[1]]
    assert pipeline.events
    assert all(abs(s.drift) <= most * (1.0 + 1e-12) for s in pipeline.standing)


def test_update_tells_the_same_as_run():
    pipeline, health = watched(bias=2.0)
    assert {
        "segment",
        "signal",
        "unit",
        "threshold",
        "start",
        "now",
        "drift",
        "seen",
        "noise",
    } == set(pipeline.standing[0].to_dict())
    other = Pipeline(ROBOT, period=1.0 / RATE)
    still = gravity_loads(ROBOT, Q)
    tau = still.torque - np.array([0.0, 2.0, 0, 0, 0, 0])
    for k in range(500):
        result = other.update(k / RATE, Q, np.zeros(6), tau, still.wrench)
    assert result.health & Health.OFFSET
    (standing,) = unlike_told(other.standing)
    assert standing.now == pytest.approx(2.0, abs=0.02)
