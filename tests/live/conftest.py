# SPDX-License-Identifier: Apache-2.0
"""Makes the helpers of this folder importable by name, and lends out the simulated arm's log."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))

from live_support import gather  # noqa: E402  (beside the path set above)

from touchline.model.robot import load_robot  # noqa: E402


@pytest.fixture(scope="session")
def sara():
    return load_robot("sara")


@pytest.fixture(scope="session")
def recorded(sara, tmp_path_factory):
    """Five seconds of sim:// seen live, by the recording's suffix."""
    folder = tmp_path_factory.mktemp("live")
    return {
        suffix: (folder / f"run{suffix}", gather(sara, "sim://?speed=0", folder / f"run{suffix}"))
        for suffix in (".parquet", ".mcap")
    }
