# SPDX-License-Identifier: Apache-2.0
"""`touchline demo`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from touchline.errors import InputError
from touchline.extras import need
from touchline.numbers import check_least, check_positive

HEADLESS_DURATION = 12.0  # s


def demo(
    headless: bool = False,
    duration: Annotated[float | None, arg(metavar="S")] = None,
    out: Annotated[Path, arg(metavar="DIR")] = Path("out/demo"),
    seed: int = 1,
    robot: Annotated[str, arg(metavar="ROBOT")] = "sara",
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1",
    port: int = 8080,
    token: bool = False,
    browser: bool = True,
    interface: bool = False,
) -> int:
    """Opens a page with an arm, simulated live: push it, and see what it feels.

    Example: touchline demo

    Drag on the arm to pull it, click on it to push it. What the estimator feels is drawn beside
    what is true; methods, noise and faults can be switched. Nothing leaves this machine. Ctrl-C
    ends it.

    With --headless, the arm moves and is touched near its base, then on the structure, the handle
    and the tool at once, and on the upper arm. The log is analyzed and compared with the truth of
    the simulation. The table of errors is printed.

    Args:
        headless: No page: simulate, analyze, print.
        duration: How long the arm moves [s]. Default: 12 with --headless, else until Ctrl-C.
        out: Directory for the log and the results of --headless.
        seed: Seed of the motion, the places and the noise.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        host: Address at which the page is served. With any but 127.0.0.1 other machines can see
            and push the arm; they need the token that is then printed.
        port: The first port that is tried; the next ones follow.
        token: Visitors need a token on this machine, too: its other users reach the page.
        browser: Open the page in the browser.
        interface: The arm has buttons, a slider and a writing pad; the mouse is a finger.
    """
    check_least(0, seed=seed)
    if headless and interface:
        raise InputError("--headless --interface: the interface is on the page; leave one out")
    if headless:
        return _print(HEADLESS_DURATION if duration is None else duration, out, seed, robot)
    if duration is not None:
        check_positive(duration=duration)
    return _show((host, port, token), seed, robot, browser, duration, interface)


def _show(
    address: tuple[str, int, bool],
    seed: int,
    robot: str,
    browser: bool,
    duration: float | None,
    interface: bool,
) -> int:
    from touchline.view.interface import InterfacePage
    from touchline.view.server import PageServer, open_page

    with PageServer("Touchline", *address) as server:
        from touchline.view.live import LivePage

        print("preparing the arm ...", flush=True)
        page = (InterfacePage if interface else LivePage)(server, seed, robot)
        print(f"the arm is at {server.url}\nCtrl-C ends it.", flush=True)
        if browser:
            open_page(server.url)
        try:
            page.run(float("inf") if duration is None else duration)
        except KeyboardInterrupt:
            print()
    return 0


def _print(duration: float, out: Path, seed: int, name: str) -> int:
    from touchline.folder import make_folder
    from touchline.logs import write_table
    from touchline.model.robot import load_robot
    from touchline.report.analysis import analyze
    from touchline.report.comparison import comparison_text
    from touchline.simulation.noise import SensorNoise
    from touchline.simulation.record import simulate_to_log
    from touchline.simulation.scene import Run

    if not 4.0 <= duration <= 600.0:
        raise InputError(f"--duration {duration}: allowed: 4 to 600 s")
    for module in ("mujoco", "pyarrow"):  # told before the work begins
        need(module)
    robot = load_robot(name)
    make_folder(out)
    print(f"simulating {duration:g} s of the arm being touched (as long on a slow machine) ...")
    log = out / "demo.parquet"
    settings = Run(seed, noise=SensorNoise())
    simulate_to_log("demo", robot, log, write_table, settings, {"seconds": duration})
    analysis = analyze(log, name, out)
    print(comparison_text(analysis.comparisons, analysis.events))
    for line in analysis.faint:
        print(f"faint: {line}")
    print(f"report: {out / 'report.html'}")
    return 0
