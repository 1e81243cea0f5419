# SPDX-License-Identifier: Apache-2.0
"""`touchline label`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def label(
    dataset: Annotated[Positional[Path], arg(metavar="DATASET")],
    /,
    robot: Annotated[str, arg(metavar="ROBOT")],
    out: Annotated[Path | None, arg(metavar="PATH")] = None,
    q: Annotated[str | None, arg(metavar="NAME")] = None,
    qd: Annotated[str | None, arg(metavar="NAME")] = None,
    tau: Annotated[str | None, arg(metavar="NAME")] = None,
    wrench: Annotated[str | None, arg(metavar="NAME")] = None,
    rate: Annotated[float | None, arg(metavar="HZ")] = None,
    bandwidth: Annotated[float | None, arg(metavar="K")] = None,
    workers: Annotated[int, arg(metavar="N")] = 0,
) -> int:
    """Adds what the arm feels to a data set for robot learning.

    Example: touchline label droid_100 --robot panda.yaml --out droid_100_touch

    DATASET is a LeRobot data set (v3), a DROID-like HDF5 or a Parquet file, or a folder of such.
    Added are, per sample: external joint torques, contact on or off, touched link, place, force,
    level, health, and a mask of the half second before a contact. LeRobot: observation.touch.*,
    described in meta/info.json and meta/touchline.json; HDF5: a group touch; Parquet: touch.*.
    Nothing else is changed; each file is replaced as a whole. Prints what the rate costs.

    Args:
        dataset: Data set with joint positions, and joint torques or wrenches as measured.
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        out: Leaves DATASET alone and labels a copy. Default: in place.
        q: Array with the joint positions. Default: known names are looked for.
        qd: Array with the joint velocities. Default: known names, else from the positions.
        tau: Array with the joint torques. Default: known names are looked for.
        wrench: Array with six numbers for each force-torque sensor. Default: known names are
            looked for.
        rate: Samples per second [Hz]. Default: as the data set tells.
        bandwidth: Bandwidth of the observer [rad/s]. Default: as described.
        workers: Processes that label the files of a LeRobot data set. Default: one per core.
    """
    import os

    from touchline.label.naming import Given
    from touchline.label.run import label as run
    from touchline.label.run import labelled_text
    from touchline.model.robot import load_robot
    from touchline.numbers import check_least

    check_least(0, workers=workers)
    model = load_robot(robot)
    given = Given(q, qd, tau, wrench, rate, bandwidth)
    done = run(dataset, model, out, given, workers or os.cpu_count() or 1)
    print(labelled_text(done, model))
    return 0
