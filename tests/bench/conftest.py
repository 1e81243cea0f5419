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


class Here:
    """Stands where a pool of processes would: the work is done in this one."""

    def __init__(self, *_: object, **__: object) -> None:
        """Begins no process."""

    def __enter__(self) -> "Here":
        return self

    def __exit__(self, *_: object) -> None:
        """Ends none."""

    def map(self, function, *arguments):
        """As of a pool."""
        return map(function, *arguments)


@pytest.fixture
def here(monkeypatch):
    """Makes a module do its work in this process."""
    return lambda module: monkeypatch.setattr(module, "workers", Here)
