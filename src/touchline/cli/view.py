# SPDX-License-Identifier: Apache-2.0
"""`touchline view`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def view(
    recording: Annotated[Positional[Path], arg(metavar="LOG|DIR")],
    /,
    robot: Annotated[str | None, arg(metavar="ROBOT")] = None,
    out: Annotated[Path | None, arg(metavar="DIR")] = None,
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1",
    port: int = 8080,
    token: bool = False,
    browser: bool = True,
) -> int:
    """Replays a recording with its contacts in the browser: time line, play, events, curves.

    Example: touchline view results

    Give the directory that `touchline analyze` wrote, or a recording, which is analyzed first.
    The page shows the arm as it stood, the contacts with force and uncertainty, and the curves
    around the time shown. It is served on this machine alone.

    Args:
        recording: Directory with the results of `touchline analyze`, or a log.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot. Needed for a log;
            results know the robot that they were made with.
        out: Where the results of a log are kept; without it they are thrown away at the end.
        host: Address at which the page is served. With any but 127.0.0.1 other machines can see
            it; they need the token that is then printed.
        port: The first port that is tried; the next ones follow.
        token: Visitors need a token on this machine, too: its other users reach the page.
        browser: Open the page in the browser.
    """
    import tempfile

    from touchline.errors import InputError
    from touchline.view.replay import Replay, is_results

    if is_results(recording):
        if out is not None:
            raise InputError(f"--out {out}: {recording} holds results already")
        return _show(Replay(recording, robot), recording, (host, port, token), browser)
    if not recording.exists():
        raise InputError(f"{recording}: no such file")
    if recording.is_dir() and not any(recording.iterdir()):
        raise InputError(f"{recording}: is empty; neither a recording nor results")
    if robot is None:
        raise InputError(f"{recording}: a recording needs --robot; results know their own")
    if out is not None:
        return _show(_analyzed(recording, robot, out), recording, (host, port, token), browser)
    with tempfile.TemporaryDirectory(prefix="touchline-view-") as folder:
        replay = _analyzed(recording, robot, Path(folder) / "results")
        return _show(replay, recording, (host, port, token), browser)


def _analyzed(log: Path, robot: str, out: Path):
    from touchline.report.analysis import analyze
    from touchline.view.replay import Replay

    analyze(log, robot, out, report="none")
    return Replay(out)


def _show(replay, name: Path, address: tuple[str, int, bool], browser: bool) -> int:
    from touchline.view.replay_page import ReplayPage
    from touchline.view.server import PageServer, open_page

    with PageServer(f"Touchline: {name.name}", *address) as server:
        page = ReplayPage(replay, server)
        print(f"{name.name}: {len(replay.events)} events in {replay.end - replay.start:.2f} s")
        print(f"the replay is at {server.url}\nCtrl-C ends it.", flush=True)
        if browser:
            open_page(server.url)
        try:
            page.run()
        except KeyboardInterrupt:
            print()
    return 0
