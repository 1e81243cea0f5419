# SPDX-License-Identifier: Apache-2.0
"""`touchline demo`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import arg


def demo(
    headless: bool = False,
    duration: Annotated[float, arg(metavar="S")] = 12.0,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/demo"),
    seed: int = 1,
) -> int:
    """Simulates the SARA-class arm being touched, analyzes it, and shows what was felt.

    Example: touchline demo --headless --duration 8

    The arm moves, is touched near its base, then on the structure, the handle and the tool at
    once, and on the upper arm. Estimates are compared with the truth of the simulation. Opens the
    report in a browser.

    Args:
        headless: Print the table of errors only; no browser.
        duration: Of the simulated recording [s].
        out: Directory for the log and the results.
        seed: Of the motion, the places and the noise.
    """
    import webbrowser

    from touchline.errors import InputError
    from touchline.logs import write_table
    from touchline.model.robot import load_robot
    from touchline.report.analysis import analyze
    from touchline.report.comparison import comparison_text
    from touchline.simulation.noise import SensorNoise
    from touchline.simulation.record import simulate_to_log
    from touchline.simulation.scene import Run

    if not 4.0 <= duration <= 600.0:
        raise InputError(f"--duration {duration}: allowed: 4 to 600 s")
    robot = load_robot("sara")
    print(f"simulating {duration:g} s of the arm being touched (as long on a slow machine) ...")
    log = out / "demo.parquet"
    settings = Run(seed, noise=SensorNoise())
    simulate_to_log("demo", robot, log, write_table, settings, {"seconds": duration})
    analysis = analyze(log, "sara", out)
    print(comparison_text(analysis.comparisons, analysis.events))
    report = out / "report.html"
    print(f"report: {report}")
    if not headless:
        webbrowser.open(report.resolve().as_uri())
    return 0
