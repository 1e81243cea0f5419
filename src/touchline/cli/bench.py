# SPDX-License-Identifier: Apache-2.0
"""`touchline bench`."""

from importlib import import_module
from typing import Literal

from tyro.conf import Positional

BENCHMARKS = {"observer": "touchline.bench.observer"}


def bench(names: Positional[tuple[Literal["observer"], ...]] = (), /) -> int:
    """Measures speed and accuracy beside the peers that are installed.

    Example: touchline bench observer

    Args:
        names: What to measure; default: everything.
    """
    for name in names or BENCHMARKS:
        import_module(BENCHMARKS[name]).main()
    return 0
