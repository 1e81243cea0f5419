# SPDX-License-Identifier: Apache-2.0
"""The faces that a line passes nearby: none is left out, whichever way the boxes are cut."""

from pathlib import Path

import pytest
from program import COMPILER, compile_program, run_program

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")


def test_faces_beside_a_line_are_those_of_a_look_at_each(tmp_path):
    source = Path(__file__).parent / "mesh_around.cpp"
    assert compile_program(source, tmp_path / "around", "-O2") == ""
    wrong, found, looked, kept = map(int, run_program(tmp_path / "around").stdout.split())
    assert wrong == 0
    assert found > 500 and looked > 20_000 and 100 < kept < found
