# SPDX-License-Identifier: Apache-2.0
"""A Franka arm over its own protocol, simulated by franky-sim in an environment of its own."""

import importlib
import os
import sys
from pathlib import Path

import pytest

BENCHMARKS = Path(__file__).parents[2] / "benchmarks"
PYTHON = os.environ.get("TOUCHLINE_FRANKY_SIM", "")


@pytest.mark.skipif(
    not PYTHON, reason="TOUCHLINE_FRANKY_SIM names no interpreter with franky-sim 1.0.4"
)
def test_lost_ticks_are_counted_exactly_and_pushes_on_a_moving_arm_are_felt(monkeypatch):
    pytest.importorskip("franky", reason="franky-control is not installed")
    monkeypatch.syspath_prepend(str(BENCHMARKS))
    run = importlib.import_module("live_franka").run
    sys.modules.pop("live_franka")
    found = run(PYTHON, 20.0, 60.0)
    assert found["lost"] == found["missing"] > 0  # by the arm's clock
    assert found["left_out"] > 0 and found["told"]
    assert found["pushes"] >= 3 and found["felt"] == found["pushes"]
