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
    host: str = "127.0.0.1",
    port: int = 8080,
    open: bool = True,
) -> int:
    """Replays a recording with its contacts in the browser: time line, play, events, curves.

    Example: touchline view results

    Give the directory that `touchline analyze` wrote, or a recording, which is analyzed first.
    The page shows the arm as it stood, the contacts with force and uncertainty, and the curves
    around the time shown. It is served on this machine alone.

    Args:
        recording: Directory with results of `touchline analyze`, or a log as it takes them.
        robot: Its robot.yaml, or the name of a robot that ships with Touchline (sara). Results
            know the robot they were made with; a log needs it.
        out: Where the results of a log are kept; without it they are thrown away at the end.
        host: Address to listen at. Another than this machine's own prints a warning and asks
            visitors for a token.
        port: To listen at; the next free one where it is taken.
        open: Open the page in the browser (--no-open: only print its address).
    """
    import tempfile

    from touchline.errors import InputError
    from touchline.view.replay import Replay, is_results

    if is_results(recording):
        if out is not None:
            raise InputError(f"--out {out}: {recording} holds results already")
        return _show(Replay(recording, robot), recording, (host, port), open)
    if recording.is_dir() and not any(recording.iterdir()):
        raise InputError(f"{recording}: is empty; neither a recording nor results")
    if robot is None:
        raise InputError(f"{recording}: a recording needs --robot; results know their own")
    if out is not None:
        return _show(_analyzed(recording, robot, out), recording, (host, port), open)
    with tempfile.TemporaryDirectory(prefix="touchline-view-") as folder:
        replay = _analyzed(recording, robot, Path(folder) / "results")
        return _show(replay, recording, (host, port), open)


def _analyzed(log: Path, robot: str, out: Path):
    from touchline.report.analysis import analyze
    from touchline.view.replay import Replay

    analyze(log, robot, out, report=False)
    return Replay(out)


def _show(replay, name: Path, address: tuple[str, int], open_it: bool) -> int:
    import webbrowser

    from touchline.view.replay_page import ReplayPage
    from touchline.view.server import PageServer

    with PageServer(f"Touchline: {name.name}", *address) as server:
        page = ReplayPage(replay, server)
        print(f"{name.name}: {len(replay.events)} events in {replay.end - replay.start:.2f} s")
        print(f"open {server.url} in a browser; Ctrl-C ends it", flush=True)
        if open_it:
            webbrowser.open(server.url)
        try:
            page.run()
        except KeyboardInterrupt:
            return 0
    return 0
