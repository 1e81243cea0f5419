# SPDX-License-Identifier: Apache-2.0
"""A learned rest acts on a joint as a torque that is taken off its reading."""

from dataclasses import replace

import numpy as np
import pytest
from free_motion import free_motion

import touchline as tl
from touchline.identify.rest import with_rest
from touchline.model.learned_rest import LearnedRest
from touchline.native import core


def table(seed=0):
    rng = np.random.default_rng(seed)
    q, qd = np.linspace(-1.2, 1.2, 9), np.sort(rng.uniform(-1.5, 1.5, 8))
    torque = np.zeros((9, 8))
    torque[1:-1, 1:-1] = rng.normal(0, 2, (7, 6))
    flat = (tuple(x.ravel().tolist()) for x in (q, qd, torque, np.abs(torque)))
    return LearnedRest(*flat)


@pytest.fixture(scope="module")
def arms():
    plain = tl.load_robot("sara")
    tables = {name: table(i) for i, name in enumerate(plain.joint_names)}
    return plain, with_rest(plain, tables), free_motion(plain, 2.0, 1000.0)


def test_it_is_a_torque_that_is_taken_off_the_reading(arms):
    plain, learned, s = arms
    tau = s.tau.copy()
    for j, joint in enumerate(learned.description.joints):
        if joint.measured:
            tau[:, j] -= joint.rest.at(s.q[:, j], s.qd[:, j])
    assert np.abs(tau - s.tau).max() > 1.0
    ours = tl.Observer(learned).run(s.time, s.q, s.qd, s.tau, s.wrench)
    theirs = tl.Observer(plain).run(s.time, s.q, s.qd, tau, s.wrench)
    np.testing.assert_allclose(ours.tau_ext, theirs.tau_ext, atol=1e-9)
    np.testing.assert_array_equal(ours.sensor_wrench, theirs.sensor_wrench)


def test_step_by_step_it_is_the_same_to_the_last_bit(arms):
    _, learned, s = arms
    whole = tl.Observer(learned).run(s.time, s.q, s.qd, s.tau, s.wrench)
    observer = tl.Observer(learned)
    for i in range(500):
        one = observer.update(s.time[i], s.q[i], s.qd[i], s.tau[i], s.wrench[i])
        np.testing.assert_array_equal(one.tau_ext, whole.tau_ext[i])


def test_the_core_refuses_a_table_that_is_none():
    good = table()
    row = core.JointRow()
    row.set_rest(good.q, good.qd, good.torque)
    for wrong in (
        replace(good, q=good.q[::-1]),
        replace(good, torque=good.torque[1:]),
        replace(good, torque=(1.0, *good.torque[1:])),
        replace(good, torque=tuple(np.nan for _ in good.torque)),
        replace(good, q=(), torque=()),
    ):
        with pytest.raises(ValueError, match="no sound table"):
            row.set_rest(wrong.q, wrong.qd, wrong.torque)
