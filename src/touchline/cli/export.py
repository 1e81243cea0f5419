# SPDX-License-Identifier: Apache-2.0
"""`touchline export`."""

from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg


def export(
    robot: Annotated[Positional[str], arg(metavar="ROBOT")],
    /,
    out: Annotated[Path, arg(metavar="FILE")],
    period: Annotated[float, arg(metavar="S")] = 1e-3,
    bandwidth: Annotated[float | None, arg(metavar="K")] = None,
) -> int:
    """Writes a robot with its surfaces as one file for C++ programs.

    Example: touchline export sara --out sara.touchline

    The file holds tree, channels, noise, thresholds, zones and surfaces, and what steps in for lost
    sensors, with a format number and a checksum. `touchline::read_robot` in
    core/include/touchline/robot_file.hpp reads it without Python, URDF or MuJoCo;
    core/example/replay.cpp shows how.

    Args:
        robot: A robot.yaml, a URDF or MJCF, or the name of a robot.
        out: The file to write. An older exported robot is replaced when the new one is whole.
        period: Time between samples [s], for thresholds and weights that follow from the noise.
        bandwidth: Bandwidth of the observer [rad/s]. Default: as described.
    """
    from touchline.folder import check_file
    from touchline.model.robot import load_robot
    from touchline.numbers import check_positive
    from touchline.pipeline.pipeline import Pipeline

    check_positive(period=period, **({} if bandwidth is None else {"bandwidth": bandwidth}))
    pipeline = Pipeline(load_robot(robot), bandwidth=bandwidth, period=period)
    for lost in pipeline.skin.lost:
        print(f"note: {lost}")
    check_file(out)
    pipeline.export(out)
    links = len(pipeline.skin.patches)
    print(f"{out}: {pipeline.robot.name}, {links} surfaces, {out.stat().st_size / 1e6:.1f} MB")
    return 0
