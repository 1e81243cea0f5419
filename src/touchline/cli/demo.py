# SPDX-License-Identifier: Apache-2.0
"""`touchline demo`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import FlagCreatePairsOff, arg


def demo(
    headless: FlagCreatePairsOff[bool] = False,
    duration: Annotated[float | None, arg(metavar="S")] = None,
    out: Annotated[Path, arg(metavar="DIR")] = Path("touchline-demo"),
) -> int:
    """Analyzes a short simulated recording of an arm that is touched, and opens the report.

    Example: touchline demo

    The recording ships with Touchline; it was made by scripts/make_demo_recording.py.

    Args:
        headless: Print what was found; open no browser.
        duration: Only the first S seconds of the recording.
        out: Directory for the results.
    """
    from touchline.report.demo import run_demo

    print(run_demo(out, duration))
    if not headless:
        import webbrowser

        webbrowser.open((out / "report.html").resolve().as_uri())
    return 0
