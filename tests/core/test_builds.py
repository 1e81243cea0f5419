# SPDX-License-Identifier: Apache-2.0
"""The builds of the native core for different processors give the same numbers."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from touchline.native import core

TESTS = Path(__file__).parents[1]
PROGRAM = """
import sys
sys.path.insert(0, {tests!r})
import numpy as np
from robots import random_robot
from touchline.observer.observer import Observer
from touchline.native import core
rng = np.random.default_rng(0)
time = np.cumsum(rng.uniform(0.5e-3, 1.5e-3, 203))
signals = [rng.normal(size=s) for s in ((203, 7), (203, 7), (203, 7), (203, 3, 6))]
signals[2][50:60, 2] = np.nan
rows = Observer(random_robot(4)).run(time, *signals).rows
np.save(sys.argv[1], rows)
print(core.INSTRUCTIONS)
"""


def rows_of(path, **environment):
    program = PROGRAM.format(tests=str(TESTS))
    command = [sys.executable, "-c", program, str(path)]
    result = subprocess.run(
        command, check=True, capture_output=True, text=True, env=os.environ | environment
    )
    return result.stdout.strip(), np.load(path)


def test_all_builds_give_the_same_numbers(tmp_path):
    name, plain = rows_of(tmp_path / "plain.npy", TOUCHLINE_INSTRUCTIONS="baseline")
    assert name == "baseline"
    name, fast = rows_of(tmp_path / "fast.npy")
    if name == "baseline":
        pytest.skip("no build for this processor alone")
    np.testing.assert_array_equal(fast, plain)


def test_one_module_holds_all_builds():
    folder = Path(core.__file__).parent
    assert len(list(folder.glob("_core*.so"))) + len(list(folder.glob("_core*.pyd"))) == 1
