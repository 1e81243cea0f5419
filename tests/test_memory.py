# SPDX-License-Identifier: Apache-2.0
"""The memory of a process is its own, not that of the process that started it."""

import subprocess
import sys

import numpy as np

from touchline.memory import peak_megabytes

CHILD = "from touchline.memory import peak_megabytes; print(peak_megabytes())"


def test_peak_is_of_this_process_and_does_not_fall():
    before = peak_megabytes()
    held = np.ones(int(400e6) // 8)
    assert peak_megabytes() >= 380
    child = subprocess.run([sys.executable, "-c", CHILD], capture_output=True, check=True)
    assert 5 < int(child.stdout) < 300
    del held
    assert peak_megabytes() >= max(380, before)
