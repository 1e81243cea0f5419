# SPDX-License-Identifier: Apache-2.0
"""`touchline teach`."""

from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional, arg


def teach(
    robot: Annotated[Positional[str], arg(metavar="ROBOT")],
    /,
    log: Annotated[Path, arg(metavar="LOG")],
    name: str,
    out: Annotated[Path, arg(metavar="ROBOT")],
    kind: Literal["button", "toggle"] = "button",
    touches: Annotated[int | None, arg(metavar="N")] = None,
) -> int:
    """Teaches a button by touching it.

    Example: touchline teach robot.yaml --log touches.parquet --name start --out robot.yaml

    Touch the spot three times, a second apart, with 5 N or more, and record it. An arm with a base
    sensor learns the place on the link. An arm with joint torques alone learns the direction of the
    torques, which holds in the posture of the recording; teach other postures with further runs.

    Args:
        robot: A robot.yaml.
        log: A recording of the touches: a table (.parquet, .csv, .csv.gz) or a rosbag2.
        name: Of the button in `interface`. What was taught for it before in other postures stays.
        out: The new robot.yaml; may be the same file.
        kind: A button, or a toggle that each touch turns on or off.
        touches: Only the first so many touches of the recording count.
    """
    from touchline.errors import InputError
    from touchline.logs import read_log
    from touchline.model.robot import load_robot
    from touchline.model.robot_file import write_description
    from touchline.touch.teach import as_yaml
    from touchline.touch.teach import teach as learn

    model = load_robot(robot)
    source = model.description.path
    if source is None:
        raise InputError(f"{robot}: has no file to start from; touchline init writes one")
    s = read_log(log, model.description)
    lesson = learn(model, s.time, s.q, s.qd, s.tau, s.wrench, kind, touches)
    known = model.description.interface.get(name)
    write_description(source, out, {"interface": {name: as_yaml(lesson.widget, known)}})
    load_robot(out)
    print(f"{name}: a {kind} from {lesson.touches} touches: {lesson.note}")
    print(f"written: {out}")
    return 0
