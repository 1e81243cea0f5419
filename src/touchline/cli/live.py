# SPDX-License-Identifier: Apache-2.0
"""`touchline live`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import arg

from touchline.numbers import check_positive


def live(
    robot: Annotated[str, arg(metavar="ROBOT")],
    source: Annotated[str, arg(metavar="SOURCE")],
    record: Annotated[Path | None, arg(metavar="LOG")] = None,
    duration: Annotated[float | None, arg(metavar="S")] = None,
    force: bool = False,
) -> int:
    """Feels with a running robot: prints contacts and faults of the link as they come.

    Example: touchline live --robot sara --source sim://

    Reads and never commands. The robot has to stand still and untouched for the first second:
    units, signs, order, rate and weight are checked, and a robot that does not fit its description
    is refused with the reason. Ctrl-C ends it.

    Args:
        robot: Its robot.yaml, or the name of a robot that ships with Touchline (sara).
        source: sim:// (a simulated arm) or replay://LOG?speed=1 (a recording, in its own time;
            speed=0: as fast as possible).
        record: Every sample as it came, to a .mcap or .parquet that `analyze` and replay:// read;
            it can be read even if this program is killed.
        duration: Ends after so long by the sensors' clock [s]. Default: until Ctrl-C, or the end.
        force: Go live whatever the first second looks like.
    """
    if duration is not None:
        check_positive(duration=duration)
    import time

    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source
    from touchline.live.telling import began_line, ended_line, notice_line, summary_lines
    from touchline.model.robot import load_robot

    model = load_robot(robot)
    connection = Connection(make_source(source, model))
    with Session(model, connection, record, force) as session:
        print(f"connecting to {source}; the robot must stand still for a second ...", flush=True)
        reasons = session.start()
        for line in [*connection.notes, *(f"forced, in spite of {reason}" for reason in reasons)]:
            print(f"  {line}")
        print("live; Ctrl-C ends it", flush=True)
        events, origin = 0, session.origin
        try:
            for news in session.run(duration):
                for notice in session.notices():
                    print(notice_line(notice, session), flush=True)
                for event in news.began:
                    print(began_line(event, origin), flush=True)
                for event in news.ended:
                    print(ended_line(event, origin), flush=True)
                events += len(news.began)
        except KeyboardInterrupt:
            print()
        for line in summary_lines(session, events, time.monotonic()):
            print(line)
    if record is not None:
        print(f"recording: {record}")
    return 0
