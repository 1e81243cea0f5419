# SPDX-License-Identifier: Apache-2.0
import os
from pathlib import Path

import pytest
from hypothesis import settings

# The same examples every time, and no clock that a busy machine could trip over.
settings.register_profile("steady", derandomize=True, deadline=None)
settings.load_profile("steady")

_REPOSITORY = Path(__file__).parents[2]
DATA = Path(os.environ.get("TOUCHLINE_DATA", _REPOSITORY.parent / "shared" / "data"))


@pytest.fixture
def data() -> Path:
    if not DATA.is_dir():
        pytest.skip(f"recordings of real robots are not at {DATA}; set TOUCHLINE_DATA")
    return DATA
