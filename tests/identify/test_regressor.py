# SPDX-License-Identifier: Apache-2.0
"""The regressors times the model's own parameters are the rows of the native core."""

import numpy as np
import pytest
from robots import random_robot

from touchline.identify.regressor import (
    body_of_vector,
    body_vector,
    momentum_regressors,
    rows_of,
)


@pytest.mark.parametrize("seed", range(6))
def test_momentum_and_bias_are_those_of_the_core(seed):
    robot = random_robot(seed, sensors=1 + seed % 3)
    rng = np.random.default_rng(seed)
    n = len(robot.joint_names)
    q, qd = rng.uniform(-2, 2, (20, n)), rng.normal(size=(20, n))
    P, B = momentum_regressors(robot, rows_of(robot), q, qd)
    parameters = np.array([body_vector(node.inertia) for node in robot.nodes])
    for i in range(len(q)):
        p, bias = robot.terms(q[i], qd[i])
        assert np.einsum("rbk,bk->r", P[i], parameters) == pytest.approx(p, rel=1e-10, abs=1e-10)
        assert np.einsum("rbk,bk->r", B[i], parameters) == pytest.approx(bias, rel=1e-10, abs=1e-10)


def test_a_body_and_its_ten_parameters():
    robot = random_robot(3)
    for node in robot.nodes:
        back = body_of_vector(body_vector(node.inertia))
        assert back.mass == pytest.approx(node.inertia.mass)
        if back.mass > 0:
            assert back.com == pytest.approx(node.inertia.com)
            assert back.inertia == pytest.approx(node.inertia.inertia)
