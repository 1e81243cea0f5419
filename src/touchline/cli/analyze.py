# SPDX-License-Identifier: Apache-2.0
"""`touchline analyze`."""

from pathlib import Path
from typing import Literal

from tyro.conf import Positional


def analyze(
    log: Positional[Path],
    /,
    robot: str,
    out: Path,
    bandwidth: float | None = None,
    method: Literal["segment", "paper"] = "segment",
) -> int:
    """Estimate wrenches and find contacts in a recording."""
    from touchline.report.analysis import analyze as run
    from touchline.report.summary import summary_text

    print(summary_text(run(log, robot, out, bandwidth, method)))
    return 0
