# SPDX-License-Identifier: Apache-2.0
"""`touchline bench`."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

BENCHMARKS = {"observer": "touchline.bench.observer"}


def bench(
    names: Annotated[Positional[tuple[Literal["observer"], ...]], arg(metavar="[NAME ...]")] = (),
    /,
    output: Annotated[Path | None, arg(metavar="FILE")] = None,
    rounds: int = 40,
) -> int:
    """Measures speed and accuracy beside the peers that are installed.

    Example: touchline bench observer

    Args:
        names: What to measure (observer); default: everything.
        output: Writes the figures here as well (.json or .csv).
        rounds: How often each candidate is timed.
    """
    for name in names or BENCHMARKS:
        import_module(BENCHMARKS[name]).main(output, rounds)
    return 0
