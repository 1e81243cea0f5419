# SPDX-License-Identifier: Apache-2.0
import fcntl
import os

import pytest
from program import HERE, compile_program, run_program


@pytest.fixture(scope="session")
def run_whole(tmp_path_factory):
    """Runs a program of `whole.cpp`; returns its lines. A run of tests makes each build once.

    Only with `counting` are allocations counted: sanitizers tell more of those that are not.
    """
    base = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        base = base.parent  # of all workers

    def run(name, flags, *arguments, counting=False):
        folder = base / "whole" / "".join(flags)
        folder.mkdir(parents=True, exist_ok=True)
        with (folder / "lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not (folder / "built").exists():
                _build(folder, flags)
        program = folder / ("counting" if counting else "plain")
        return run_program(program, name, *arguments).stdout.splitlines()

    return run


def _build(folder, flags):
    part = folder / "whole.o"
    complaint = compile_program(HERE / "whole.cpp", part, "-c", *flags)
    complaint += compile_program(part, folder / "plain", *flags)
    complaint += compile_program(part, folder / "counting", *flags, HERE / "counting.cpp")
    if "lasan" in complaint or "lubsan" in complaint:
        pytest.skip("the compiler has no sanitizers")
    assert complaint == ""
    part.unlink()
    (folder / "built").touch()
