# SPDX-License-Identifier: Apache-2.0
"""`touchline reproduce`."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg

from touchline.numbers import check_least

Name = Literal["fig4", "fig5", "fig6", "applications"]


def reproduce(
    names: Annotated[Positional[tuple[Name, ...]], arg(metavar="NAME ...")] = (),
    /,
    *,
    out: Annotated[Path, arg(metavar="DIR")],
    seed: int = 0,
) -> int:
    """Runs the paper's experiments again, with every method side by side and the truth.

    Example: touchline reproduce fig4 --out results

    Writes into DIR a page, index.html, and for each experiment a folder with its figures (PDF,
    SVG, PNG), the plotted series and the tables (CSV), and a page of its own.
    Exit status: 0 everything that must hold holds, 1 something does not, 2 bad input.

    Args:
        names: The experiments: fig4, fig5, fig6, applications. Default: all.
        out: Directory for the results; files of the same name in it are replaced.
        seed: Seed of all that is random: the same seed gives the same numbers.
    """
    from touchline.reproduce.run import reproduce as run
    from touchline.reproduce.run import summary_text

    check_least(0, seed=seed)
    experiments = run(names, out, seed)
    print(summary_text(experiments, out))
    return 0 if all(c.holds for e in experiments for c in e.checks) else 1
