# SPDX-License-Identifier: Apache-2.0
"""`touchline bench`."""

from importlib import import_module
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

BENCHMARKS = {
    "observer": "touchline.bench.observer",
    "localization": "touchline.bench.localization",
}


Name = Literal["observer", "localization"]


def bench(
    names: Annotated[
        Positional[tuple[Literal["observer", "localization"], ...]], arg(metavar="[NAME ...]")
    ] = (),
    /,
    output: Annotated[Path | None, arg(metavar="FILE")] = None,
    rounds: int = 40,
) -> int:
    """Measures speed and accuracy beside the peers that are installed.

    Example: touchline bench observer

    Args:
        names: What to measure (observer, localization); default: everything.
        output: Writes the figures here as well (.json or .csv), one file per name.
        rounds: How often each candidate is timed; ten touches with each force.
    """
    wanted = names or tuple(BENCHMARKS)
    for name in wanted:
        several = output is not None and len(wanted) > 1
        file = output.with_stem(f"{output.stem}-{name}") if output and several else output
        import_module(BENCHMARKS[name]).main(file, rounds)
    return 0
