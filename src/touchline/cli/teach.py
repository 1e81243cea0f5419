# SPDX-License-Identifier: Apache-2.0
"""`touchline teach`."""

from pathlib import Path
from typing import Annotated, Any, Literal

from tyro.conf import Positional, arg

from touchline.cli.described import described
from touchline.numbers import check_least, check_positive


def teach(
    robot: Annotated[Positional[str], arg(metavar="ROBOT")],
    /,
    name: Annotated[str, arg(metavar="NAME")],
    out: Annotated[Path, arg(metavar="ROBOT")],
    log: Annotated[Path | None, arg(metavar="LOG")] = None,
    live: Annotated[str | None, arg(metavar="SOURCE")] = None,
    kind: Literal["button", "toggle"] = "button",
    touches: Annotated[int | None, arg(metavar="N")] = None,
    duration: Annotated[float, arg(metavar="S")] = 20.0,
) -> int:
    """Teaches a button by touching it.

    Example: touchline teach robot.yaml --log touches.parquet --name start --out robot.yaml

    Touch the spot three times, a second apart, with 5 N or more, and record it. An arm with a base
    sensor learns the place on the link. An arm with joint torques alone learns the direction of the
    torques, which holds in the posture of the recording; teach other postures with further runs.

    Args:
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        name: Name of the button in `interface`. What it was taught in other postures stays.
        out: The new robot.yaml; may be the same file.
        kind: A button, or a toggle that each touch turns on or off.
        log: A recording of the touches: a table (.parquet, .csv, .csv.gz) or a rosbag2.
        live: Instead of a recording the running robot, as `touchline live --source` takes it. It
            has to stand still and untouched for the first second.
        touches: Only so many touches count, the first ones. Default: all.
        duration: How long touches are waited for with --live [s]. Ctrl-C ends it earlier.
    """
    from touchline.errors import InputError
    from touchline.model.robot import load_robot
    from touchline.model.robot_file import write_description
    from touchline.touch.teach import as_yaml
    from touchline.touch.teach import teach as learn

    if (log is None) == (live is None):
        raise InputError("teach: give either --log LOG or --live SOURCE")
    check_positive(duration=duration)
    if touches is not None:
        check_least(1, touches=touches)
    with described(robot, log, out) as start:
        model = load_robot(start)
        source = model.description.path
        assert source is not None
        s = _felt(model, log, live, duration)
        lesson = learn(model, s.time, s.q, s.qd, s.tau, s.wrench, kind, touches)
        known = model.description.interface.get(name)
        write_description(source, out, {"interface": {name: as_yaml(lesson.widget, known)}})
    load_robot(out)
    print(f"{name}: a {kind} from {lesson.touches} touches: {lesson.note}")
    print(f"written: {out}")
    return 0


def _felt(model: Any, log: Path | None, live: str | None, duration: float) -> Any:
    """The samples of a recording, or of the next seconds of a running robot."""
    from tempfile import TemporaryDirectory

    from touchline.logs import read_log

    if log is not None:
        return read_log(log, model.description)
    from touchline.live.connection import Connection
    from touchline.live.session import Session
    from touchline.live.sources import make_source

    with TemporaryDirectory(prefix="touchline-") as folder:
        record = Path(folder) / "touches.parquet"
        connection = Connection(make_source(str(live), model))
        with Session(model, connection, record) as session:
            print(f"connecting to {live}; the robot must stand still for a second ...", flush=True)
            session.start()
            print(f"touch the spot now, a second apart; {duration:g} s; Ctrl-C ends it", flush=True)
            try:
                for news in session.run(duration):
                    for event in news.began:
                        print(f"  felt at {event.detected - session.origin:.2f} s", flush=True)
            except KeyboardInterrupt:
                print()
        return read_log(record, model.description)
