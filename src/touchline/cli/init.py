# SPDX-License-Identifier: Apache-2.0
"""`touchline init`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def init(
    model: Annotated[Positional[str], arg(metavar="MODEL")],
    log: Annotated[Positional[Path | None], arg(metavar="[LOG]")] = None,
    /,
    *,
    out: Annotated[Path, arg(metavar="ROBOT")],
    overwrite: bool = False,
) -> int:
    """Writes a first robot.yaml from a model and a recording, and says what it guessed.

    Example: touchline init arm.urdf run1.mcap --out robot.yaml

    A model does not tell how joint torques are measured, which joints are fingers, or where a
    recording has each signal. These are guessed from names; each guess is printed and stands in the
    file as a comment. Nothing is asked. Then run `touchline check ROBOT LOG`.

    Args:
        model: A URDF, MJCF or xacro, or the name of one in the package example-robot-data or in
            the cache of robot_descriptions.
        log: A recording: a table (.parquet, .csv, .csv.gz) or a rosbag2 (.mcap, .db3, its folder).
        out: The new robot.yaml.
        overwrite: Replace a file that is there.
    """
    from touchline.init.run import init as run

    draft = run(model, log, out, overwrite)
    print(f"{out}: written. It assumes:")
    for statement in draft.statements:
        print(f"  - {statement}")
    for caution in draft.cautions:
        print(f"  ! {caution}")
    print(f"next: touchline check {out}" + (f" {log}" if log is not None else " LOG"))
    return 0
