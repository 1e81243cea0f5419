# SPDX-License-Identifier: Apache-2.0
"""A wheel on a machine without a compiler: eight robots from their models to results.

Needs a wheel of this version (`make wheels`) in TOUCHLINE_WHEEL and the models that
`scripts/acceptance.py` names; minutes long, so it runs where it is asked for.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

from touchline.cli import main

SCRIPT = Path(__file__).parents[2] / "scripts" / "acceptance.py"
ROW = "| {title} | `"


def cases():
    spec = importlib.util.spec_from_file_location("acceptance", SCRIPT)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["acceptance"] = module  # dataclasses look their module up
    spec.loader.exec_module(module)
    return module.CASES


def test_eight_robots_in_a_fresh_environment():
    wheel = os.environ.get("TOUCHLINE_WHEEL")
    if wheel is None:
        pytest.skip("name a wheel of this version in TOUCHLINE_WHEEL; `make wheels` builds one")
    done = subprocess.run(
        [sys.executable, str(SCRIPT), wheel], capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert len(cases()) == 8
    for case in cases():
        assert ROW.format(title=case.title) in done.stdout, done.stdout


def test_an_arm_by_name_without_a_line_by_hand(tmp_path, capsys):
    """The same steps here, for the one arm whose model comes with the tests."""
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    log, robot, out = (str(tmp_path / name) for name in ("log.parquet", "robot.yaml", "out"))
    options = ["--robot", "xarm7", "--out", log, "--seconds", "1"]
    assert main(["simulate", "free_motion", *options]) == 0
    assert main(["init", "xarm7", log, "--out", robot]) == 0
    assert main(["analyze", log, "--robot", robot, "--out", out]) == 0
    assert "`torque: motor`" in capsys.readouterr().out
    assert (tmp_path / "out" / "report.html").exists()
