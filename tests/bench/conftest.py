# SPDX-License-Identifier: Apache-2.0
"""Where recordings of real arms are."""

import os
from pathlib import Path

import pytest

REPOSITORY = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="session")
def data():
    """The folder of recordings; skips where there is none, or no model of the arms."""
    folder = Path(os.environ.get("TOUCHLINE_DATA", REPOSITORY.parent / "shared" / "data"))
    if not folder.is_dir():
        pytest.skip(f"no recordings at {folder}: set TOUCHLINE_DATA")
    pytest.importorskip("pinocchio", reason="comes with example-robot-data, the arms' models")
    return folder
