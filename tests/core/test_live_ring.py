# SPDX-License-Identifier: Apache-2.0
"""The ring, the runner and the admission of samples, compiled against the headers alone."""

from pathlib import Path

import pytest
from program import COMPILER, THREADED, compile_program, run_program


@pytest.mark.skipif(COMPILER is None, reason="no C++ compiler on this machine")
@pytest.mark.parametrize("flags", [("-O2",), (*THREADED, "-g")])
def test_what_goes_from_thread_to_thread_arrives_in_order_and_whole(tmp_path, flags):
    source, program = Path(__file__).parent / "live_ring.cpp", tmp_path / "ring"
    complaint = compile_program(source, program, *flags, "-pthread")
    if "-fsanitize=thread" in flags and "ltsan" in complaint:
        pytest.skip("the compiler lacks its thread sanitizer")
    assert complaint == ""
    assert run_program(program).stdout.endswith("0 failures\n")
