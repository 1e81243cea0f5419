# SPDX-License-Identifier: Apache-2.0
"""A description to start from, also of a robot of which only the model is there."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def described(robot: str, log: Path | None, out: Path) -> Iterator[str]:
    """Yield a robot that has a description: for a model a first one, as `touchline init` makes it.

    Args:
        robot: a robot.yaml, a URDF or MJCF, or the name of a robot.
        log: a recording that tells columns and sensors.
        out: the description that is written in the end; the first one stands beside it meanwhile.

    Raises:
        InputError: the robot or the recording cannot be read, or nothing can be written there.
    """
    from touchline.init.run import init
    from touchline.model.sources import find_robot

    if find_robot(robot).kind == "description":
        yield robot
        return
    draft = out.with_name(f".{out.stem}.first.yaml")
    try:
        made = init(robot, log, draft, overwrite=True)
        print("assumed, as there is no robot.yaml; it stands as comments in the new one:")
        print("\n".join(f"  {line}" for line in (*made.statements, *made.cautions)), end="\n\n")
        yield str(draft)
    finally:
        draft.unlink(missing_ok=True)
