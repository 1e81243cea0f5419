# SPDX-License-Identifier: Apache-2.0
"""Samples side by side give the numbers of samples one by one, whatever is wrong with them."""

from pathlib import Path

import pytest
from program import COMPILER, compile_program, run_program

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


@pytest.mark.parametrize("flags", [("-O2",), ("-O2", "-mavx2")], ids=["two", "four"])
def test_a_recording_in_any_parts_has_the_numbers_of_single_steps(flags, tmp_path):
    if "-mavx2" in flags and "avx2" not in _cpu():
        pytest.skip("this processor has no AVX2")
    program = tmp_path / "side_by_side"
    assert compile_program(Path(__file__).parent / "side_by_side.cpp", program, *flags) == ""
    differ, _, numbers, _ = run_program(program).stdout.split()
    assert differ == "0"
    assert int(numbers) > 1e6


def _cpu():
    info = Path("/proc/cpuinfo")
    return info.read_text() if info.exists() else ""
