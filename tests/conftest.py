# SPDX-License-Identifier: Apache-2.0
"""Makes the test oracles importable by name, and lends out a browser."""

import fcntl
import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest

# Tests run beside each other: threads of one test's linear algebra wait for those of the others.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parent / "estimation"))


@pytest.fixture
def browser() -> Iterator["Browser"]:
    """A headless Chromium; one at a time on this machine, since it draws on the processor.

    Without Chromium the test fails in CI (`CI=true`) and is skipped elsewhere.
    """
    if chromium() is None:
        (pytest.fail if os.environ.get("CI") else pytest.skip)(MISSING)
    with (Path(tempfile.gettempdir()) / f"touchline-browser-{os.getuid()}.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        with Browser() as window:
            yield window


from browser import MISSING, Browser, chromium  # noqa: E402  (beside the path set above)
