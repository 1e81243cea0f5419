# SPDX-License-Identifier: Apache-2.0
"""Makes the support module importable, and the shipped arm."""

import sys
from pathlib import Path

import pytest

import touchline as tl

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="session")
def sara():
    return tl.load_robot("sara")
