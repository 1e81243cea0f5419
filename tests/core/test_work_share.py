# SPDX-License-Identifier: Apache-2.0
"""How the segments, and pipelines that take the same sample, share the work of its searches."""

from pathlib import Path

import pytest
from program import COMPILER, compile_program, run_program

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


def test_the_searches_of_a_sample_share_its_work(tmp_path):
    source = Path(__file__).parent / "work_share.cpp"
    assert compile_program(source, tmp_path / "work_share") == ""
    assert run_program(tmp_path / "work_share").stdout == ""
