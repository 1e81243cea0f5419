# SPDX-License-Identifier: Apache-2.0
"""`touchline live`."""

from contextlib import ExitStack
from pathlib import Path
from typing import Annotated, Any

from tyro.conf import arg

from touchline.numbers import check_positive


def live(
    robot: Annotated[str, arg(metavar="ROBOT")],
    source: Annotated[str, arg(metavar="SOURCE")],
    record: Annotated[Path | None, arg(metavar="LOG")] = None,
    events: Annotated[Path | None, arg(metavar="JSONL")] = None,
    duration: Annotated[float | None, arg(metavar="S")] = None,
    force: bool = False,
    view: bool = False,
    allow_control: bool = False,
    host: Annotated[str, arg(metavar="ADDRESS")] = "127.0.0.1",
    port: int = 8080,
    token: bool = False,
    browser: bool = True,
) -> int:
    """Feels with a running robot: prints contacts and faults of the link as they come.

    Example: touchline live --robot sara --source sim://

    Reads and never commands. The robot has to stand still and untouched for the first second:
    units, signs, order, rate and weight are checked, and a robot that does not fit its description
    is refused with the reason. Ctrl-C ends it.

    Args:
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        source: sim:// (a simulated arm), replay://LOG?speed=1 (a recording, in its own time;
            speed=0: as fast as possible), ros2:// (topics), ur://HOST (a UR arm), franka://HOST.
        record: Keeps every sample as it came in a .mcap or .parquet, which `analyze` and replay://
            read. It can be read even if this program is killed.
        events: Keeps each event when it is over, as a line of JSON with the keys of events.json.
        duration: How long it goes on, by the sensors' clock [s]. Default: until Ctrl-C, or the end.
        force: Goes live whatever the first second looks like.
        view: Shows the robot and what it feels on a page.
        allow_control: Visitors of the page may let the estimate start anew, and tare.
        host: Address at which the page is served. With any but 127.0.0.1 other machines can see
            it; they need the token that is then printed.
        port: The first port that is tried; the next ones follow.
        token: Visitors need a token on this machine, too: its other users reach the page.
        browser: Open the page in the browser.
    """
    if duration is not None:
        check_positive(duration=duration)
    from touchline.folder import check_file
    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source
    from touchline.model.robot import load_robot

    model = load_robot(robot)
    for option, path in (("--record", record), ("--events", events)):
        if path is not None:
            check_file(path, option)
    connection = Connection(make_source(source, model))
    with Session(model, connection, record, force, events) as session, ExitStack() as kept:
        print(f"connecting to {source}; the robot must stand still for a second ...", flush=True)
        reasons = session.start()
        for line in [*connection.notes, *(f"forced, in spite of {reason}" for reason in reasons)]:
            print(f"  {line}")
        page = None
        if view:
            page = _page(kept, session, allow_control, (host, port, token), browser)
        print("live; Ctrl-C ends it", flush=True)
        _follow(session, duration, page)
    if record is not None:
        print(f"recording: {record}")
    return 0


def _page(
    kept: ExitStack,
    session: Any,
    allow_control: bool,
    address: tuple[str, int, bool],
    browser: bool,
) -> Any:
    from touchline.live.page import RobotPage
    from touchline.view.server import PageServer, open_page

    server = kept.enter_context(PageServer("Touchline", *address))
    page = RobotPage(server, session, allow_control)
    print(f"the robot is at {server.url}")
    if browser:
        open_page(server.url)
    return page


def _follow(session: Any, duration: float | None, page: Any) -> None:
    """Tells what happens until it is over."""
    import time

    from touchline.live.telling import (
        began_line,
        ended_line,
        notice_line,
        summary_lines,
        touch_line,
    )

    events, origin = 0, session.origin
    try:
        for news in session.run(duration):
            for notice in session.notices():
                print(notice_line(notice, session), flush=True)
            for event in news.began:
                print(began_line(event, origin), flush=True)
            for touch in news.touches:
                if touch.kind != "change":  # a slider that moves changes with every sample
                    print(touch_line(touch, origin), flush=True)
            for event in news.ended:
                print(ended_line(event, origin), flush=True)
            events += len(news.began)
            if page is not None:
                page.update()
    except KeyboardInterrupt:
        print()
    for line in summary_lines(session, events, time.monotonic()):
        print(line)
