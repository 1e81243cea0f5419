# SPDX-License-Identifier: Apache-2.0
"""The headers alone: the C++ example, no allocation per step, clean under sanitizers."""

from pathlib import Path

import numpy as np
import pytest
from program import COMPILER, HERE, SANITIZED, compile_program, run_program

ROOT = Path(__file__).parents[2]

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


def test_example_prints_the_push(tmp_path):
    source = ROOT / "core" / "example" / "pushed_arm.cpp"
    assert compile_program(source, tmp_path / "arm", "-O1") == ""
    lines = run_program(tmp_path / "arm").stdout.splitlines()
    assert lines[0].split()[0] == "time"
    table = np.array([line.split() for line in lines[1:]], dtype=float)
    time, fx, fz, my, tau1, tau2, health = table.T
    quiet, pushed = time < 0.35, time > 0.55
    np.testing.assert_allclose(table[quiet, 1:6], 0.0, atol=1e-3)
    np.testing.assert_allclose(fx[pushed], 5.0, atol=0.01)
    np.testing.assert_allclose(fz[pushed], -20.0, atol=0.03)
    # The base moment of the push is that of the first joint, whose axis passes the sensor.
    np.testing.assert_allclose(my, tau1, atol=1e-3)
    # In both, at the last line: r x f at the tip, with the arm where its sines have taken it.
    angle = np.array([0.4, 1.0]) * np.sin(2.0 * time[-1])
    links = 0.4 * np.stack([np.cos(angle), -np.sin(angle)], axis=1)
    arms = np.array([links.sum(axis=0), links[1]])
    torque = arms[:, 1] * 5.0 - arms[:, 0] * -20.0
    np.testing.assert_allclose([tau1[-1], tau2[-1]], torque, atol=0.1)  # 1/K behind a moving arm
    assert health[0] == 1 and (health[1:] == 0).all()


@pytest.mark.parametrize("flags", [("-O2",), SANITIZED], ids=["plain", "sanitized"])
def test_no_allocation_per_step(tmp_path, flags):
    program = tmp_path / "program"
    source, counting = HERE / "no_allocation.cpp", HERE / "counting.cpp"
    complaint = compile_program(source, program, *flags, counting)
    if flags == SANITIZED and ("lasan" in complaint or "lubsan" in complaint):
        pytest.skip("the compiler has no sanitizers")
    assert complaint == ""
    for line in run_program(program).stdout.splitlines():
        allocations, stepped, ran = line.split()
        assert allocations == "0"
        assert stepped == ran  # `run` gives the numbers of `step`, bad samples included
